"""Formats and settings of cameras on Linux, from the kernel (V4L2).

OpenCV rounds and renames values (0.25 for "manual" becomes 0, which is automatic) and reports no
ranges.
"""

from __future__ import annotations

import ctypes
import errno
import os
from collections.abc import Callable, Iterator
from typing import Any

from app.sources.source import SourceSetting
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.session.camera_controls import CONTROLS, ORDER

from .driver import CameraDisconnected, CameraFormat

VIDIOC_ENUM_FMT = 0xC0405602
VIDIOC_G_CTRL = 0xC008561B
VIDIOC_S_CTRL = 0xC008561C
VIDIOC_QUERYCTRL = 0xC0445624
VIDIOC_QUERYMENU = 0xC02C5625
VIDIOC_ENUM_FRAMESIZES = 0xC02C564A
VIDIOC_ENUM_FRAMEINTERVALS = 0xC034564B
VIDIOC_REQBUFS = 0xC0145608
VIDIOC_STREAMON = 0x40045612
VIDIOC_STREAMOFF = 0x40045613

CAPTURE = 1
MAPPED = 1
DISCRETE = 1
DISABLED, GRABBED, READ_ONLY, INACTIVE = 0x1, 0x2, 0x4, 0x10


def _words(*names: str) -> tuple[tuple[str, type], ...]:
    return tuple((name, ctypes.c_uint32) for name in names)


class FormatDescription(ctypes.Structure):
    """``struct v4l2_fmtdesc``."""

    _fields_ = (
        *_words("index", "type", "flags"),
        ("description", ctypes.c_char * 32),
        *_words("pixelformat", "mbus_code"),
        ("reserved", ctypes.c_uint32 * 3),
    )


class FrameSize(ctypes.Structure):
    """``struct v4l2_frmsizeenum``: width and height, or minimum, maximum and step of both."""

    _fields_ = (
        *_words("index", "pixel_format", "type"),
        ("values", ctypes.c_uint32 * 6),
        ("reserved", ctypes.c_uint32 * 2),
    )


class FrameInterval(ctypes.Structure):
    """``struct v4l2_frmivalenum``: a fraction of a second, or minimum, maximum and step of it."""

    _fields_ = (
        *_words("index", "pixel_format", "width", "height", "type"),
        ("values", ctypes.c_uint32 * 6),
        ("reserved", ctypes.c_uint32 * 2),
    )


class QueryControl(ctypes.Structure):
    """``struct v4l2_queryctrl``."""

    _fields_ = (
        *_words("id", "type"),
        ("name", ctypes.c_char * 32),
        ("minimum", ctypes.c_int32),
        ("maximum", ctypes.c_int32),
        ("step", ctypes.c_int32),
        ("default_value", ctypes.c_int32),
        *_words("flags"),
        ("reserved", ctypes.c_uint32 * 2),
    )


class QueryMenu(ctypes.Structure):
    """``struct v4l2_querymenu``, packed as in the kernel."""

    _pack_ = 1
    _layout_ = "ms"
    _fields_ = (*_words("id", "index"), ("name", ctypes.c_char * 32), *_words("reserved"))


class ControlValue(ctypes.Structure):
    """``struct v4l2_control``."""

    _fields_ = (("id", ctypes.c_uint32), ("value", ctypes.c_int32))


class RequestedBuffers(ctypes.Structure):
    """``struct v4l2_requestbuffers``."""

    _fields_ = _words("count", "type", "memory", "capabilities", "flags")


Ioctl = Callable[[int, int, Any], Any]

MOST = 256
"""Limit of any list from a camera; a longer list comes from a defective one."""
# Sizes to try if the camera reports a range of sizes instead of a list.
USUAL_SIZES = ((640, 480), (800, 600), (1280, 720), (1280, 960), (1600, 1200), (1920, 1080))

EXPOSURE_MANUAL, EXPOSURE_AUTO, EXPOSURE_APERTURE = 1, 0, 3
MAINS_HZ = {0: 0.0, 1: 50.0, 2: 60.0}


_KNOWN = {
    "exposure_auto": 0x9A0901,
    "exposure_ms": 0x9A0902,
    "rate_follows_exposure": 0x9A0903,
    "focus": 0x9A090A,
    "focus_auto": 0x9A090C,
    "brightness": 0x980900,
    "contrast": 0x980901,
    "saturation": 0x980902,
    "white_balance_auto": 0x98090C,
    "gamma": 0x980910,
    "gain_auto": 0x980912,
    "gain": 0x980913,
    "power_line_hz": 0x980918,
    "white_balance_k": 0x98091A,
    "sharpness": 0x98091B,
    "backlight": 0x98091C,
}
"""Number of each control in the kernel."""
_SCALES = {"exposure_ms": 0.1}
"""Size of the kernel's unit in ours, where it is not 1: it counts in 100 us."""


class V4l2Device:
    """A video device, open at the same time as the capture that reads its images.

    Parameters
    ----------
    path : str
        Device path, such as ``/dev/video0``.
    ioctl : callable, optional
        Calls the kernel; by default ``fcntl.ioctl``.

    Raises
    ------
    CameraDisconnected
        If the device cannot be opened.
    """

    def __init__(self, path: str, *, ioctl: Ioctl | None = None) -> None:
        if ioctl is None:
            from fcntl import ioctl as kernel  # no such module on Windows

            ioctl = kernel
        self.path, self._ioctl = path, ioctl
        try:
            self._file = os.open(path, os.O_RDWR | os.O_NONBLOCK)
        except OSError as error:
            raise disconnected_error(path, error) from error

    def close(self) -> None:
        """Close the device. A second call has no effect."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    # Formats

    def formats(self) -> tuple[CameraFormat, ...]:
        """Return every format, size and rate that the camera lists."""
        return tuple(
            CameraFormat(_letters(code), width, height, rate)
            for code in self._codes()
            for width, height in self._sizes(code)
            for rate in self._rates(code, width, height)
        )

    def _codes(self) -> list[int]:
        formats = self._list(VIDIOC_ENUM_FMT, lambda n: FormatDescription(index=n, type=CAPTURE))
        return [description.pixelformat for description in formats]

    def _sizes(self, code: int) -> list[tuple[int, int]]:
        sizes = []
        for size in self._list(
            VIDIOC_ENUM_FRAMESIZES, lambda n: FrameSize(index=n, pixel_format=code)
        ):
            if size.type == DISCRETE:
                sizes.append((size.values[0], size.values[1]))
                continue
            low_w, high_w, _, low_h, high_h, _ = size.values
            sizes += [
                (w, h) for w, h in USUAL_SIZES if low_w <= w <= high_w and low_h <= h <= high_h
            ]
            break
        return sizes

    def _rates(self, code: int, width: int, height: int) -> list[float]:
        def query(n: int) -> FrameInterval:
            return FrameInterval(index=n, pixel_format=code, width=width, height=height)

        rates = []
        for interval in self._list(VIDIOC_ENUM_FRAMEINTERVALS, query):
            seconds, parts = interval.values[0], interval.values[1]
            if seconds and parts:
                rates.append(round(parts / seconds, 3))
            if interval.type != DISCRETE:
                break
        return rates

    # Settings

    def controls(self) -> tuple[SourceSetting, ...]:
        """Return the camera's settings in the order in which they are applied."""
        return tuple(filter(None, (self._control(key) for key in ORDER if key in _KNOWN)))

    def set(self, key: str, value: float) -> None:
        """Request a value within the range that the camera reports.

        Raises
        ------
        InputError
            If there is no such control or the camera rejects the value.
        CameraDisconnected
            If the camera is gone.
        """
        query = self._query(key)
        if query is None:
            raise InputError(
                f"the camera has no setting {_label(key)}",
                self.path,
                Remedy.NO_SUCH_SETTING,
            )
        number = self._number_of(key, value, query)
        try:
            self._ask(VIDIOC_S_CTRL, ControlValue(query.id, number))
        except OSError as error:
            raise InputError(
                f"the camera rejects {_label(key)} {value:g} ({error.strerror})",
                self.path,
                "Switch off the camera's automatic settings, and lock again",
            ) from error

    def _control(self, key: str) -> SourceSetting | None:
        query = self._query(key)
        if query is None:
            return None
        try:
            reading = ControlValue(query.id, 0)
            self._ask(VIDIOC_G_CTRL, reading)
        except OSError:
            return None  # listed but not readable: some cameras do that
        kind, scale = CONTROLS[key], _SCALES.get(key, 1.0)
        writable = not query.flags & (READ_ONLY | GRABBED | INACTIVE)
        low, high, step, value = 0.0, 1.0, 1.0, float(reading.value != 0)
        if key == "exposure_auto":
            value = float(reading.value != EXPOSURE_MANUAL)
        elif key == "power_line_hz":
            high, step = 60.0, 10.0
            value = MAINS_HZ.get(reading.value, 0.0)
        elif not kind.switch:
            low, high = query.minimum * scale, query.maximum * scale
            step, value = max(query.step, 1) * scale, reading.value * scale
        low, high, step, value = (round(x, 6) for x in (low, high, step, value))
        return SourceSetting(key, kind.label, kind.unit, low, high, step, value, writable)

    def _query(self, key: str) -> QueryControl | None:
        query = QueryControl(id=_KNOWN[key]) if key in _KNOWN else None
        if query is None:
            return None
        try:
            self._ask(VIDIOC_QUERYCTRL, query)
        except OSError:
            return None
        return None if query.flags & DISABLED else query

    def _number_of(self, key: str, value: float, query: QueryControl) -> int:
        """Return a value in the kernel's units."""
        if key == "exposure_auto":
            return self._automatic_exposure(query) if value else EXPOSURE_MANUAL
        if key == "power_line_hz":
            return min(MAINS_HZ, key=lambda number: abs(MAINS_HZ[number] - value))
        number = round(value / _SCALES.get(key, 1.0))
        return int(min(max(number, query.minimum), query.maximum))

    def _automatic_exposure(self, query: QueryControl) -> int:
        """Return the automatic exposure mode of the camera. Most have only one."""
        for number in (EXPOSURE_APERTURE, EXPOSURE_AUTO):
            try:
                self._ask(VIDIOC_QUERYMENU, QueryMenu(id=query.id, index=number))
            except OSError:
                continue
            return number
        return EXPOSURE_APERTURE

    def lacks_bandwidth(self) -> bool:
        """Return whether the USB bus has no room left for the camera's images.

        A capture that has the camera open must be released before.
        """
        kind = ctypes.c_int(CAPTURE)
        try:
            self._ioctl(self._file, VIDIOC_REQBUFS, RequestedBuffers(1, CAPTURE, MAPPED))
            self._ioctl(self._file, VIDIOC_STREAMON, kind)
            self._ioctl(self._file, VIDIOC_STREAMOFF, kind)
            self._ioctl(self._file, VIDIOC_REQBUFS, RequestedBuffers(0, CAPTURE, MAPPED))
        except OSError as error:
            return error.errno == errno.ENOSPC
        return False

    # The kernel

    def _list(self, request: int, make: Callable[[int], Any]) -> Iterator[Any]:
        for index in range(MOST):
            item = make(index)
            try:
                self._ask(request, item)
            except OSError:
                return
            yield item

    def _ask(self, request: int, argument: Any) -> None:
        try:
            self._ioctl(self._file, request, argument)
        except OSError as error:
            if error.errno in (errno.ENODEV, errno.ENXIO, errno.EBADF):
                raise disconnected_error(self.path, error) from error
            raise


def disconnected_error(address: str, error: OSError) -> CameraDisconnected:
    """Return why a camera cannot be used, from the system's error."""
    message = "the camera was not found"
    advice: Remedy | str = Remedy.PLUG_IN
    if error.errno in (errno.EBUSY, errno.EAGAIN):
        message, advice = "another program uses the camera", Remedy.CLOSE_PROGRAM
    elif error.errno in (errno.EACCES, errno.EPERM):
        message = "this user has no permission to use the camera"
        advice = 'Add the user to the group "video", and log in again'
    return CameraDisconnected(message, address, advice)


def _letters(code: int) -> str:
    return bytes((code >> shift) & 0xFF for shift in (0, 8, 16, 24)).decode("latin-1").strip()


def _label(key: str) -> str:
    return CONTROLS[key].label if key in CONTROLS else key
