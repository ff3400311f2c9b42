"""The sizes that an image file declares, read from its header without a decoder."""

from __future__ import annotations

import struct
from collections.abc import Iterator

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
