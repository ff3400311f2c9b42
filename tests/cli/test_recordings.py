"""Recordings on the command line."""

import cv2
import numpy as np
import pytest
from one_line import refusal
from recorded import noisy, write_recording

from app.cli.inputs import frame_range
from app.cli.main import main
from gelpolight_core.output.recording.recording_format import RecordingHeader
from gelpolight_core.output.recording.recording_writer import RecordingWriter


@pytest.fixture
def recording(press, tmp_path):
    """Return a recording of three frames. The last two are the press, and one was lost."""
    rgb = np.ascontiguousarray(cv2.imread(str(press))[..., ::-1])
    path = tmp_path / "day.1.gplrec"
    header = RecordingHeader(serial="virtual-1", source="bench", settings={"exposure_ms": 3.0})
    with RecordingWriter(path, header) as writer:
        writer.append(noisy(0, rgb.shape[:2]), 0, 0.0)
        writer.append(rgb, 1, 0.1)
        writer.append(rgb, 3, 0.3)
    return path


@pytest.mark.function("`gelpolight reconstruct`: frames of a recording")
def test_a_frame_of_a_recording_gives_the_same_result_as_its_image(
    calibration, press, recording, tmp_path, capsys
):
    """To the last bit."""
    out = tmp_path / "out"
    both = ["reconstruct", str(calibration), str(press), str(recording), "-o", str(out)]
    assert main([*both, "--frames", "1:3"]) == 0
    reported = capsys.readouterr()
    assert "3 depth maps" in reported.out
    assert "1 frames of the source are missing in the recording" in reported.err
    names = ["day.1_000001.npz", "day.1_000002.npz"]
    assert sorted(p.name for p in out.iterdir()) == sorted([f"{press.stem}.npz", *names])
    with np.load(out / f"{press.stem}.npz") as one:
        for name in names:
            with np.load(out / name) as other:
                for key in ("depth_mm", "normals", "flags"):
                    assert one[key].tobytes() == other[key].tobytes()


def test_a_recording_of_another_sensor_is_refused_by_name(calibration, tmp_path, capsys):
    path = tmp_path / "a.gplrec"
    write_recording(path, header=RecordingHeader(serial="B-7"))
    output = refusal(
        capsys, "reconstruct", str(calibration), str(path), "-o", str(tmp_path / "out")
    )
    assert "The recording is of sensor B-7, but the calibration is of sensor virtual-1" in output
    assert not (tmp_path / "out").exists()


def test_a_range_of_frames_needs_a_recording(calibration, press, tmp_path, capsys):
    arguments = ("reconstruct", str(calibration), str(press), "-o", str(tmp_path / "out"))
    assert "--frames: " in refusal(capsys, *arguments, "--frames", "0:1")


@pytest.mark.parametrize(
    ("text", "frames"),
    [
        ("", range(5)),
        ("1:3", range(1, 3)),
        (":2", range(2)),
        ("3:", range(3, 5)),
        (":", range(5)),
        ("0:99", range(5)),
        ("4", range(4, 5)),
        ("1::2", range(1, 5, 2)),
    ],
)
def test_a_range_of_frames_reads_like_a_slice(text, frames):
    assert frame_range(text, 5, where="a") == frames


@pytest.mark.function("`gelpolight inspect`: the content of a recording")
def test_inspect_shows_the_content_of_a_recording(recording, capsys):
    assert main(["inspect", str(recording)]) == 0
    shown = " ".join(capsys.readouterr().out.split())
    for words in (
        "sensor virtual-1",
        "frames 3 in 0.30 s",
        "frames lost 1",
        "complete yes",
        "exposure_ms 3.0",
    ):
        assert words in shown
