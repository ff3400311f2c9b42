"""Camera formats and settings on Linux, in the kernel's own structures."""

import ctypes
import errno
from typing import Any

import pytest

from app.sources.camera_drivers import v4l2
from app.sources.camera_drivers.driver import CameraDisconnected, CameraFormat
from app.sources.camera_drivers.v4l2 import V4l2Device
from gelpolight_core.base.errors import InputError

EXPOSURE_AUTO, EXPOSURE, FRAME_RATE = 0x9A0901, 0x9A0902, 0x9A0903
WHITE_AUTO, WHITE, GAIN, MAINS = 0x98090C, 0x98091A, 0x980913, 0x980918


def code_of(letters: str) -> int:
    return int.from_bytes(letters.encode(), "little")


class Kernel:
    """Behaves like the driver of a UVC camera: two exposure modes in a menu, units of 100 us."""

    def __init__(self) -> None:
        self.values = {EXPOSURE_AUTO: 3, EXPOSURE: 156, FRAME_RATE: 1, WHITE_AUTO: 1}
        self.values |= {WHITE: 4600, GAIN: 0, MAINS: 2}
        self.ranges = {
            EXPOSURE_AUTO: (0, 3, 1),
            EXPOSURE: (1, 10000, 1),
            FRAME_RATE: (0, 1, 1),
            WHITE_AUTO: (0, 1, 1),
            WHITE: (2800, 6500, 10),
            GAIN: (0, 255, 1),
            MAINS: (0, 2, 1),
        }
        self.sizes = {"YUYV": [(640, 480), (1280, 960)], "MJPG": [(1280, 960)]}
        self.error = 0
        self.start_error = 0
        self.buffers = 0
        self.is_on = False
        self.asked: list[tuple[int, int]] = []

    def __call__(self, _file: int, request: int, argument: Any) -> int:
        if self.error:
            raise OSError(self.error, "broken")
        {
            v4l2.VIDIOC_ENUM_FMT: self._format,
            v4l2.VIDIOC_ENUM_FRAMESIZES: self._size,
            v4l2.VIDIOC_ENUM_FRAMEINTERVALS: self._interval,
            v4l2.VIDIOC_QUERYCTRL: self._query,
            v4l2.VIDIOC_QUERYMENU: self._menu,
            v4l2.VIDIOC_G_CTRL: self._get,
            v4l2.VIDIOC_S_CTRL: self._set,
            v4l2.VIDIOC_REQBUFS: self._request_buffers,
            v4l2.VIDIOC_STREAMON: self._start,
            v4l2.VIDIOC_STREAMOFF: self._stop,
        }[request](argument)
        return 0

    def _request_buffers(self, a: Any) -> None:
        assert (a.type, a.memory, self.is_on) == (1, 1, False)
        self.buffers = a.count

    def _start(self, kind: Any) -> None:
        assert kind.value == 1 and self.buffers
        if self.start_error:
            raise OSError(self.start_error, "cannot start")
        self.is_on = True

    def _stop(self, kind: Any) -> None:
        assert kind.value == 1
        self.is_on = False

    def _format(self, a: Any) -> None:
        assert a.type == 1
        a.pixelformat = code_of(_at(list(self.sizes), a.index))

    def _size(self, a: Any) -> None:
        sizes = next(sizes for name, sizes in self.sizes.items() if code_of(name) == a.pixel_format)
        a.type = 1
        a.values[0], a.values[1] = _at(sizes, a.index)

    def _interval(self, a: Any) -> None:
        a.type = 1
        seconds, parts = _at([(1, 30), (2, 15)], a.index)
        a.values[0], a.values[1] = seconds, parts

    def _query(self, a: Any) -> None:
        if a.id not in self.ranges:
            raise OSError(errno.EINVAL, "no such control")
        a.minimum, a.maximum, a.step = self.ranges[a.id]
        held_by = {EXPOSURE: (EXPOSURE_AUTO, 3), WHITE: (WHITE_AUTO, 1)}.get(a.id)
        if held_by and self.values[held_by[0]] == held_by[1]:
            a.flags = v4l2.INACTIVE

    def _menu(self, a: Any) -> None:
        if a.id != EXPOSURE_AUTO or a.index not in (1, 3):
            raise OSError(errno.EINVAL, "no such item")

    def _get(self, a: Any) -> None:
        a.value = self.values[a.id]

    def _set(self, a: Any) -> None:
        self.asked.append((a.id, a.value))
        if a.id == EXPOSURE_AUTO and a.value not in (1, 3):
            raise OSError(errno.EINVAL, "Invalid argument")
        low, high, _ = self.ranges[a.id]
        self.values[a.id] = min(max(a.value, low), high)


def _at(items: list[Any], index: int) -> Any:
    if index >= len(items):
        raise OSError(errno.EINVAL, "the end")
    return items[index]


@pytest.fixture
def kernel():
    return Kernel()


@pytest.fixture
def camera(kernel, tmp_path):
    (tmp_path / "video0").touch()
    opened = V4l2Device(str(tmp_path / "video0"), ioctl=kernel)
    yield opened
    opened.close()


def values(camera: V4l2Device) -> dict[str, float]:
    return {setting.key: setting.value for setting in camera.controls()}


def test_the_requests_match_the_kernel_header():
    """Size and direction are part of the numbers, so a wrong structure gives another number."""
    for request, structure in (
        (v4l2.VIDIOC_ENUM_FMT, v4l2.FormatDescription),
        (v4l2.VIDIOC_ENUM_FRAMESIZES, v4l2.FrameSize),
        (v4l2.VIDIOC_ENUM_FRAMEINTERVALS, v4l2.FrameInterval),
        (v4l2.VIDIOC_QUERYCTRL, v4l2.QueryControl),
        (v4l2.VIDIOC_QUERYMENU, v4l2.QueryMenu),
        (v4l2.VIDIOC_G_CTRL, v4l2.ControlValue),
        (v4l2.VIDIOC_S_CTRL, v4l2.ControlValue),
        (v4l2.VIDIOC_REQBUFS, v4l2.RequestedBuffers),
        (v4l2.VIDIOC_STREAMON, ctypes.c_int),
        (v4l2.VIDIOC_STREAMOFF, ctypes.c_int),
    ):
        assert (request >> 16) & 0x3FFF == ctypes.sizeof(structure), structure.__name__


def test_every_format_size_and_rate_is_listed(camera):
    assert camera.formats() == (
        CameraFormat("YUYV", 640, 480, 30.0),
        CameraFormat("YUYV", 640, 480, 7.5),
        CameraFormat("YUYV", 1280, 960, 30.0),
        CameraFormat("YUYV", 1280, 960, 7.5),
        CameraFormat("MJPG", 1280, 960, 30.0),
        CameraFormat("MJPG", 1280, 960, 7.5),
    )


def test_settings_have_common_units(camera):
    found = {setting.key: setting for setting in camera.controls()}
    exposure = found["exposure_ms"]
    assert (exposure.value, exposure.low, exposure.high, exposure.step) == (15.6, 0.1, 1000.0, 0.1)
    assert not exposure.writable  # automatic exposure
    assert found["exposure_auto"].value == 1.0
    assert found["power_line_hz"].value == 60.0
    assert "focus" not in found


def test_exposure_is_set_after_automatic_exposure_is_off(camera, kernel):
    camera.set("exposure_auto", 0.0)
    camera.set("exposure_ms", 9.5)
    camera.set("white_balance_auto", 0.0)
    camera.set("white_balance_k", 5000.0)
    camera.set("power_line_hz", 50.0)
    assert kernel.values[EXPOSURE_AUTO] == 1  # manual; many guides say 0.25
    assert kernel.values[EXPOSURE] == 95
    assert values(camera) | {"exposure_ms": 9.5, "white_balance_k": 5000.0} == values(camera)
    assert {s.key: s.writable for s in camera.controls()}["exposure_ms"]
    assert kernel.values[MAINS] == 1


def test_missing_and_rejected_settings_are_reported(camera, kernel):
    with pytest.raises(InputError, match="no setting Focus"):
        camera.set("focus", 1.0)
    kernel.ranges[EXPOSURE_AUTO] = (0, 0, 1)
    kernel._menu = lambda a: _at([], a.index)  # type: ignore[method-assign]

    def refuse(a: Any) -> None:
        raise OSError(errno.EIO, "Input/output error")

    kernel._set = refuse  # type: ignore[method-assign]
    with pytest.raises(InputError, match=r"rejects Gain 3 \(Input/output error\)"):
        camera.set("gain", 3.0)


def test_an_unplugged_camera_raises_camera_gone(camera, kernel):
    kernel.error = errno.ENODEV
    with pytest.raises(CameraDisconnected, match="not found"):
        camera.controls()
    with pytest.raises(CameraDisconnected):
        camera.set("gain", 1.0)
    for number, words in (
        (errno.ENOENT, "not found"), (errno.EBUSY, "another program"), (errno.EACCES, '"video"'),
    ):  # fmt: skip
        assert words in str(v4l2.disconnected_error("/dev/video9", OSError(number, "no")))


@pytest.mark.parametrize(("error", "lacks"), [(0, False), (errno.ENOSPC, True), (errno.EIO, False)])
def test_a_bus_without_room_for_the_images_is_told_by_starting_them(camera, kernel, error, lacks):
    kernel.start_error = error
    assert camera.lacks_bandwidth() == lacks
    assert not kernel.is_on
    assert error or not kernel.buffers
