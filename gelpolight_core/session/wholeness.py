"""Whether a picture file is what it says and whole, before a decoder makes what it can of it."""

from __future__ import annotations

import zlib
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from gelpolight_core.errors import InputError
from gelpolight_core.reading import read_file
from gelpolight_core.session.declared import PNG_HEAD, TIFF_HEADS, declared_sizes
from gelpolight_core.translation import tr

MAX_PIXELS = 64_000_000
# Three channels of 16 bit, and what a file has beside them.
FILE_LIMIT = 6 * MAX_PIXELS + (1 << 20)


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


def decode_picture(path: Path, flags: int = cv2.IMREAD_UNCHANGED) -> np.ndarray[Any, Any] | None:
    """Return the values of a picture file as OpenCV orders them; None if it is not a whole one.

    Parameters
    ----------
    path : Path
        The file.
    flags : int, optional
        What OpenCV shall make of it, such as a smaller picture.

    Raises
    ------
    InputError
        If the file is missing, cannot be read, or declares more pixels than any camera has.
    """
    try:
        data = read_file(path, FILE_LIMIT)
    except FileNotFoundError as error:
        raise InputError(
            tr("there is no such file"), where=str(path), advice=tr("Check the file's name")
        ) from error
    _check_declared_size(path, data)
    if not is_whole_picture(data):
        return None
    try:
        raw = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error:
        return None
    return None if raw is None or (raw.ndim == 3 and raw.shape[2] not in (3, 4)) else raw


def _check_declared_size(path: Path, data: bytes) -> None:
    """Refuse a picture that declares more than any camera gives, before memory is taken."""
    for width, height in declared_sizes(data):
        if width * height > MAX_PIXELS:
            raise InputError(
                tr("the picture declares {w} x {h} pixels").format(w=width, h=height),
                where=str(path),
                advice=tr("Use pictures of at most {n} megapixels").format(n=MAX_PIXELS // 10**6),
            )
