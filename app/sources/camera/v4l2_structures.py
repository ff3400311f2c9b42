"""Structures and request numbers of V4L2, as in ``linux/videodev2.h``."""

from __future__ import annotations

import ctypes

VIDIOC_ENUM_FMT = 0xC0405602
VIDIOC_G_CTRL = 0xC008561B
VIDIOC_S_CTRL = 0xC008561C
VIDIOC_QUERYCTRL = 0xC0445624
VIDIOC_QUERYMENU = 0xC02C5625
VIDIOC_ENUM_FRAMESIZES = 0xC02C564A
VIDIOC_ENUM_FRAMEINTERVALS = 0xC034564B

CAPTURE = 1
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
