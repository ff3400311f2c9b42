"""Compress the pixels of a frame into strips, and decompress them."""

from __future__ import annotations

import numpy as np
from isal import isal_zlib

from gelpolight_core.recording.recording import Rgb

STRIPS = 4
PACKING = 1
"""Compression level; because of noise, higher levels gain nothing."""


def strip_rows(rows: int, strips: int) -> list[slice]:
    """Return the rows of each strip: equal counts, as required by TIFF, and a remainder."""
    step = -(-rows // strips)
    return [slice(first, min(first + step, rows)) for first in range(0, rows, step)]


def pack_pixels(rgb: Rgb) -> list[bytes]:
    """Return the compressed strips of a frame.

    Parameters
    ----------
    rgb : (rows, columns, 3) uint8 or uint16
        At least one pixel.
    """
    differences = np.empty(rgb.shape, rgb.dtype)
    differences[:, 0] = rgb[:, 0]
    np.subtract(rgb[:, 1:], rgb[:, :-1], out=differences[:, 1:])
    return [
        isal_zlib.compress(differences[rows].reshape(-1).view(np.uint8), PACKING)
        for rows in strip_rows(rgb.shape[0], STRIPS)
    ]


def unpack_strip(data: bytes, rgb: Rgb) -> bool:
    """Fill the rows of a strip; return whether the data contained exactly these rows.

    Parameters
    ----------
    data : bytes
        Compressed.
    rgb : (rows, columns, 3) uint8 or uint16
        Output array; contiguous.
    """
    unpacker = isal_zlib.decompressobj()
    try:
        content = unpacker.decompress(data, rgb.nbytes + 1)
    except isal_zlib.error:  # type: ignore[misc]  # an instance in its stub, but really a class
        return False
    if len(content) != rgb.nbytes or not unpacker.eof or unpacker.unused_data:
        return False
    from gelpolight_core.recording.differences import add_up  # starts compilation

    add_up(np.frombuffer(content, rgb.dtype).reshape(rgb.shape), rgb)
    return True
