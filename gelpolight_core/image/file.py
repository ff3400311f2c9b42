"""Check that an image file is complete before a decoder reads what it can of it."""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.io.reading import missing_file, read_file
from gelpolight_core.translation import tr

MAX_PIXELS = 64_000_000
# Three channels of 16 bit, and some overhead.
FILE_LIMIT = 6 * MAX_PIXELS + (1 << 20)


def is_complete_image(data: bytes) -> bool:
    """Return whether the bytes are a PNG with intact chunks, or a TIFF.

    Other formats such as JPEG are lossy or not linear and are refused even under a wrong file
    extension. TIFF has no checksums; its decoder reports missing data.

    References
    ----------
    PNG specification (third edition), 5.3 "Chunk layout".
    """
    if data.startswith(TIFF_HEADS):
        return True
    if not data.startswith(PNG_HEAD):
        return False
    view, position = memoryview(data), len(PNG_HEAD)
    while position + 12 <= len(data):
        end = position + 8 + int.from_bytes(view[position : position + 4], "big")
        if zlib.crc32(view[position + 4 : end]) != int.from_bytes(view[end : end + 4], "big"):
            return False
        if data[position + 4 : position + 8] == b"IEND":
            return True
        position = end + 4
    return False


def decode_image(path: Path, flags: int | None = None) -> np.ndarray[Any, Any] | None:
    """Return the values of an image file in OpenCV's order; None if the file is not complete.

    Parameters
    ----------
    path : Path
        The file.
    flags : int, optional
        Flags for OpenCV, such as those for a reduced size.

    Raises
    ------
    InputError
        If the file is missing, cannot be read, or declares more pixels than any camera has.
    """
    import cv2

    flags = cv2.IMREAD_UNCHANGED if flags is None else flags
    data = read_image_file(path)
    _check_declared_size(path, data)
    if not is_complete_image(data):
        return None
    try:
        raw = cv2.imdecode(np.frombuffer(data, np.uint8), flags)
    except cv2.error:
        return None
    return None if raw is None or (raw.ndim == 3 and raw.shape[2] not in (3, 4)) else raw


def read_image_file(path: Path) -> bytes:
    """Return the content of an image file.

    Raises
    ------
    InputError
        If it is missing, cannot be read, or is too large.
    """
    try:
        return read_file(path, FILE_LIMIT)
    except FileNotFoundError as error:
        raise missing_file(path) from error


def _check_declared_size(path: Path, data: bytes) -> None:
    """Refuse an image that declares more pixels than any camera has, before memory is allocated."""
    for width, height in declared_sizes(data):
        if width * height > MAX_PIXELS:
            raise InputError(
                tr("The image declares {w} x {h} pixels, more than {n} megapixels").format(
                    w=width, h=height, n=MAX_PIXELS // 10**6
                ),
                path,
                Remedy.SMALLER_IMAGES,
            )


PNG_HEAD = b"\x89PNG\r\n\x1a\n"
TIFF_HEADS = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_KINDS = {1: "B", 3: "H", 4: "I", 16: "Q"}
_TAGS = {256: "width", 257: "height", 277: "samples", 322: "tile_width", 323: "tile_height"}


def declared_sizes(data: bytes) -> Iterator[tuple[int, int]]:
    """Yield every (width, height) for which a PNG or TIFF makes its decoder allocate memory.

    These are the sizes of the image, of the frames of an animated PNG, and of a TIFF's tiles. A
    TIFF with more than four samples per pixel counts as correspondingly wider.

    References
    ----------
    PNG specification (third edition), 11.2.1 "IHDR" and 11.3.6.2 "fcTL"; TIFF 6.0, section 2;
    BigTIFF.
    """
    if data.startswith(PNG_HEAD):
        yield from _png_sizes(data)
    elif data.startswith(TIFF_HEADS):
        yield from _tiff_sizes(data)


def _png_sizes(data: bytes) -> Iterator[tuple[int, int]]:
    position = len(PNG_HEAD)
    while position + 12 <= len(data):
        (length,) = struct.unpack_from(">I", data, position)
        kind, body = data[position + 4 : position + 8], position + 8
        if kind == b"fcTL":
            body += 4
        if kind in (b"IHDR", b"fcTL") and body + 8 <= len(data):
            yield struct.unpack_from(">II", data, body)
        position += 12 + length


def _tiff_sizes(data: bytes) -> Iterator[tuple[int, int]]:
    """Yield the sizes in the first directory, which is the one that is decoded."""
    order, big = "<" if data[:2] == b"II" else ">", 43 in data[2:4]
    offset, count, entry, room = ("Q", "Q", 20, 8) if big else ("I", "H", 12, 4)
    try:
        (position,) = struct.unpack_from(order + offset, data, 8 if big else 4)
        (entries,) = struct.unpack_from(order + count, data, position)
        position += struct.calcsize(order + count)
        values: dict[str, int] = {}
        for at in range(position, min(position + entries * entry, len(data) - entry + 1), entry):
            tag, kind = struct.unpack_from(order + "HH", data, at)
            if tag in _TAGS and kind in _KINDS:
                (value,) = struct.unpack_from(order + _KINDS[kind], data, at + entry - room)
                values[_TAGS[tag]] = max(value, values.get(_TAGS[tag], 0))
    except struct.error:
        return  # truncated: the decoder will report it
    wider = max(1, -(-values.get("samples", 1) // 4))
    yield wider * values.get("width", 0), values.get("height", 0)
    yield wider * values.get("tile_width", 0), values.get("tile_height", 0)
