"""The sizes that a picture file declares, read from its head alone: no decoder is asked."""

from __future__ import annotations

import struct
from collections.abc import Iterator

PNG_HEAD = b"\x89PNG\r\n\x1a\n"
TIFF_HEADS = (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+")
_KINDS = {1: "B", 3: "H", 4: "I", 16: "Q"}
_TAGS = {256: "width", 257: "height", 277: "samples", 322: "tile_width", 323: "tile_height"}


def declared_sizes(data: bytes) -> Iterator[tuple[int, int]]:
    """Yield every (width, height) that a PNG or TIFF makes its decoder take memory for.

    That of the picture, of the frames of an animated PNG, and of a TIFF's tiles; a TIFF of more
    samples than four to a pixel counts as so much wider.

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
    place = len(PNG_HEAD)
    while place + 12 <= len(data):
        (length,) = struct.unpack_from(">I", data, place)
        kind, body = data[place + 4 : place + 8], place + 8
        if kind == b"fcTL":
            body += 4
        if kind in (b"IHDR", b"fcTL") and body + 8 <= len(data):
            yield struct.unpack_from(">II", data, body)
        place += 12 + length


def _tiff_sizes(data: bytes) -> Iterator[tuple[int, int]]:
    """Yield what the first directory says, which is the one that is decoded."""
    order, big = "<" if data[:2] == b"II" else ">", 43 in data[2:4]
    offset, count, entry, room = ("Q", "Q", 20, 8) if big else ("I", "H", 12, 4)
    try:
        (place,) = struct.unpack_from(order + offset, data, 8 if big else 4)
        (entries,) = struct.unpack_from(order + count, data, place)
        place += struct.calcsize(order + count)
        said: dict[str, int] = {}
        for at in range(place, min(place + entries * entry, len(data) - entry + 1), entry):
            tag, kind = struct.unpack_from(order + "HH", data, at)
            if tag in _TAGS and kind in _KINDS:
                (value,) = struct.unpack_from(order + _KINDS[kind], data, at + entry - room)
                said[_TAGS[tag]] = max(value, said.get(_TAGS[tag], 0))
    except struct.error:
        return  # its end is missing: for the decoder to say
    wider = max(1, -(-said.get("samples", 1) // 4))
    yield wider * said.get("width", 0), said.get("height", 0)
    yield wider * said.get("tile_width", 0), said.get("tile_height", 0)
