"""Whether a picture file is what it says and whole, before a decoder makes what it can of it."""

from __future__ import annotations

import zlib
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr

MAX_PIXELS = 64_000_000
PNG_HEAD = b"\x89PNG\r\n\x1a\n"
TIFF_HEADS = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")


def is_whole_picture(data: bytes) -> bool:
    """Return whether the bytes are a PNG whose every chunk is as it was written, or a TIFF.

    Other kinds, JPEG among them, are lossy or not linear and may not pass under another name.
    TIFF has no checksums; what a decoder finds missing in one is for it to say.

    References
    ----------
    PNG specification (third edition), 5.3 "Chunk layout".
    """
    if data.startswith(TIFF_HEADS):
        return True
    if not data.startswith(PNG_HEAD):
        return False
    view, place = memoryview(data), len(PNG_HEAD)
    while place + 12 <= len(data):
        end = place + 8 + int.from_bytes(view[place : place + 4], "big")
        if zlib.crc32(view[place + 4 : end]) != int.from_bytes(view[end : end + 4], "big"):
            return False
        if data[place + 4 : place + 8] == b"IEND":
            return True
        place = end + 4
    return False


def decode_picture(path: Path) -> np.ndarray[Any, Any] | None:
    """Return the values of a picture file as OpenCV orders them; None if it is not a whole one.

    Raises
    ------
    InputError
        If the file cannot be read, or declares more pixels than any camera has.
    """
    try:
        data = np.fromfile(path, dtype=np.uint8)
    except OSError as error:
        raise unreadable(error, path) from error
    _check_declared_size(path, data[:64].tobytes())
    if not is_whole_picture(data.tobytes()):
        return None
    try:
        return cv2.imdecode(data, cv2.IMREAD_UNCHANGED)
    except cv2.error:
        return None


def unreadable(error: OSError, path: Path) -> InputError:
    """Return what to raise about a file that the system does not give."""
    return InputError(
        tr("the file cannot be read ({reason})").format(reason=error.strerror or error),
        where=str(path),
        advice=tr("Check its permissions and the disk, or copy it to a folder of your own"),
    )


def _check_declared_size(path: Path, head: bytes) -> None:
    """Refuse a PNG that declares more pixels than any camera has, before memory is taken."""
    if head[:8] != b"\x89PNG\r\n\x1a\n" or len(head) < 24:
        return
    width, height = int.from_bytes(head[16:20], "big"), int.from_bytes(head[20:24], "big")
    if width * height > MAX_PIXELS:
        raise InputError(
            tr("the picture declares {w} x {h} pixels").format(w=width, h=height),
            where=str(path),
            advice=tr("Use pictures of at most {n} megapixels").format(n=MAX_PIXELS // 10**6),
        )
