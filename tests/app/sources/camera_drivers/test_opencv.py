"""Images through OpenCV, from a file as from a camera, with OpenCV's known errors."""

import sys
import time
from types import ModuleType, SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from fake_camera import eventually

from app.sources.camera_drivers import opencv
from app.sources.camera_drivers.camera_source import CameraSource
from app.sources.camera_drivers.driver import CameraDevice, CameraDisconnected
from app.sources.camera_drivers.opencv import OpenCvDriver
from app.sources.camera_drivers.shared_camera import SharedCamera
from app.sources.source import SourceFrame
from app.sources.stream import Stream
from gelpolight_core.base.errors import InputError, Remedy

SIZE = (64, 48)


@pytest.fixture
def film(tmp_path):
    """Return a film of five images as a device: red on the left, blue on the right."""
    path = tmp_path / "film.avi"
    writer = cv2.VideoWriter(
        str(path), cv2.CAP_OPENCV_MJPEG, cv2.VideoWriter.fourcc(*"MJPG"), 25.0, SIZE
    )
    assert writer.isOpened()
    for number in range(5):
        bgr = np.zeros((SIZE[1], SIZE[0], 3), np.uint8)
        bgr[:, :32, 2] = 200 - 10 * number
        bgr[:, 32:, 0] = 200
        writer.write(bgr)
    writer.release()
    return CameraDevice("film", "film.avi", "", str(path))


def test_a_film_is_read_as_from_a_camera_in_red_green_blue(film):
    driver = OpenCvDriver(interface=cv2.CAP_FFMPEG)
    assert driver.formats(film) == ()
    camera = driver.open(film, None)
    before = time.monotonic()
    images = [camera.read() for _ in range(5)]
    got = camera.format
    assert (got.code, got.width, got.height, got.rate_hz) == ("MJPG", 64, 48, 25.0)
    assert got.compressed
    for number, (rgb, came_s) in enumerate(filter(None, images)):
        assert before <= came_s <= time.monotonic()
        left, right = rgb[:, 4:28].mean(axis=(0, 1)), rgb[:, 36:60].mean(axis=(0, 1))
        assert left == pytest.approx([200 - 10 * number, 0, 0], abs=6)
        assert right == pytest.approx([0, 0, 200], abs=6)
    with pytest.raises(CameraDisconnected, match="no more images"):
        camera.read()
    assert camera.controls() == ()
    with pytest.raises(InputError, match="does not accept Gain"):
        camera.set("gain", 1.0)
    camera.close()


@pytest.mark.function("Use a film as a camera")
def test_a_film_acts_as_a_camera_and_restarts_at_its_end(film):
    class Films(OpenCvDriver):
        def devices(self) -> tuple[CameraDevice, ...]:
            return (film,)

    camera = SharedCamera(Films(interface=cv2.CAP_FFMPEG), film)
    stream = Stream(CameraSource(camera))
    seen: list[SourceFrame] = []
    stream.add_tap(seen.append)
    stream.start()
    assert "delivers no more images" in eventually(lambda: stream.figures().lost)
    last = seen[-1].rgb[:, 4:28].mean(axis=(0, 1))
    assert last == pytest.approx([160, 0, 0], abs=6)
    count = len(seen)
    eventually(lambda: len(seen) > count)
    stream.stop()
    assert camera.state.format.code == "MJPG"


class Capture:
    """A VideoCapture as on Windows: accepts every value, but sets others."""

    def __init__(self, address: Any, interface: int) -> None:
        self.address, self.interface = address, interface
        self.asked: list[tuple[int, float]] = []
        self.values = {cv2.CAP_PROP_EXPOSURE: -6.0, cv2.CAP_PROP_GAIN: 10.0}
        self.answers: list[Any] = []

    def isOpened(self) -> bool:
        return True

    def set(self, number: int, value: float) -> bool:
        self.asked.append((number, value))
        self.values[number] = value
        return True

    def get(self, number: int) -> float:
        return self.values.get(number, -1.0)

    def grab(self) -> bool:
        time.sleep(self.answers[0][0])
        return self.answers[0][1] is not None

    def retrieve(self) -> tuple[bool, Any]:
        return True, self.answers.pop(0)[1]

    def release(self) -> None:
        self.values.clear()


def test_an_image_repeated_after_a_timeout_is_dropped(monkeypatch):
    monkeypatch.setattr(opencv, "SLOW_READ_S", 0.02)
    capture = Capture(0, 0)
    device = CameraDevice("a", "camera", "", "0")
    camera = OpenCvDriver(lambda *_: capture, interface=cv2.CAP_DSHOW).open(device, None)
    grey = np.full((4, 6), 3, np.uint8)
    capture.answers = [(0.05, grey), (0.0, grey), (0.0, None)]
    assert camera.read() is None
    capture.answers.pop(0)
    read = camera.read()
    assert read[0].shape == (4, 6, 3)
    with pytest.raises(CameraDisconnected):
        camera.read()


def test_cameras_are_identified_by_their_identity_not_their_number(monkeypatch, tmp_path):
    port = tmp_path / "devices" / "usb1" / "1-2" / "1-2:1.0"
    port.mkdir(parents=True)
    (tmp_path / "video3").mkdir()
    (tmp_path / "video3" / "device").symlink_to(port)
    assert opencv._linux_port("/dev/video3", tmp_path) == "1-2:1.0"
    (port.parent / "serial").write_text("5A1F33B0\n")
    assert opencv._linux_port("/dev/video3", tmp_path) == "5A1F33B0/1.0 at 1-2"
    (port.parent / "serial").write_text("00000000\n")  # common to all cheap cameras
    assert opencv._linux_port("/dev/video3", tmp_path) == "1-2:1.0"
    assert opencv._linux_port("/dev/video9", tmp_path) == "/dev/video9"

    found = SimpleNamespace(name="UVC Camera", path="/dev/video3", vid=0x46D, pid=0x81B, index=3)
    module = ModuleType("cv2_enumerate_cameras")
    module.enumerate_cameras = lambda interface: [found]  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "cv2_enumerate_cameras", module)
    (device,) = OpenCvDriver().devices()
    assert device.identity.startswith("046d:081b@")
    assert device.name == "UVC Camera"
    monkeypatch.setattr(opencv, "LINUX", False)
    (device,) = OpenCvDriver(interface=cv2.CAP_DSHOW).devices()
    assert device.address == "3"


@pytest.mark.function("Learn that two cameras need more than their USB bus has")
@pytest.mark.parametrize("sent", [0, 1])
def test_a_second_camera_on_a_full_bus_is_told_from_a_broken_cable(monkeypatch, sent):
    class FullBus:
        path = "/dev/video2"

        def lacks_bandwidth(self) -> bool:
            assert not capture.values  # the capture was released
            return True

        def close(self) -> None:
            pass

    capture = Capture(0, 0)
    grey = np.full((4, 6), 3, np.uint8)
    capture.answers = [(0.0, grey)] * sent + [(0.0, None)]
    device = CameraDevice("a", "camera", "", "0")
    camera = opencv.OpenCvCamera(device, capture, FullBus())  # type: ignore[arg-type]
    for _ in range(sent):
        assert camera.read() is not None
    with pytest.raises(CameraDisconnected) as lost:
        camera.read()
    expected = Remedy.CHECK_CABLE if sent else Remedy.OTHER_BUS
    assert lost.value.advice == expected.format()
