"""The list of cameras, as text and as JSON."""

import json
import sys
from types import ModuleType

import pytest
from fake_camera import C310, FORMATS, CameraDevice, FakeCamera, FakeDriver

from app.cli.cameras import report
from app.cli.main import main


def test_without_a_camera_the_message_explains_what_to_do(capsys, monkeypatch):
    module = ModuleType("cv2_enumerate_cameras")
    module.enumerate_cameras = lambda interface: []  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "cv2_enumerate_cameras", module)
    assert main(["cameras"]) == 0
    assert "No camera was found" in capsys.readouterr().out


@pytest.mark.function("`gelpolight cameras`: formats and settings of the cameras")
def test_formats_and_settings_are_listed_and_the_best_format_is_marked(capsys, tmp_path):
    busy = FakeCamera(
        device=CameraDevice("1:2@x", "Other", "0001:0002", "/dev/video2"), in_use=True
    )
    fake = FakeCamera()
    report(FakeDriver(fake, busy), tmp_path / "cameras.json")
    output = capsys.readouterr().out
    assert f"{C310.name}  [046d:081b@SN1]  /dev/video0" in output
    assert "* YUYV 128 x 96 at 7.5 images/s\n" in output
    assert "  MJPG 64 x 48 at 30 images/s, compressed" in output
    assert "Not locked" in output
    assert "Other: the camera cannot be opened" in output
    first, second = json.loads((tmp_path / "cameras.json").read_text())["cameras"]
    assert len(first["formats"]) == len(FORMATS)
    assert first["controls"]["exposure_ms"]["unit"] == "ms"
    assert second["trouble"].startswith("Other: ")
    assert (fake.opened, fake.closed) == (1, 1)
