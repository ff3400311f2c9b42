"""The pixels of a frame, packed into strips and unpacked."""

from __future__ import annotations

import numba
import numpy as np
from isal import isal_zlib

from gelpolight_core.recording.recording import Rgb

STRIPS = 4
PACKING = 1
"""Level of the packing; noise leaves nothing for the higher ones to find."""


def strip_rows(rows: int, strips: int) -> list[slice]:
    """Return the rows of each strip: equal counts, as TIFF wants them, and a rest."""
    step = -(-rows // strips)
    return [slice(first, min(first + step, rows)) for first in range(0, rows, step)]


def pack_pixels(rgb: Rgb) -> list[bytes]:
    """Return the packed strips of a frame.

    Parameters
    ----------
    rgb : (rows, columns, 3) uint8 or uint16
        Of at least one pixel.
    """
    differences = np.empty(rgb.shape, rgb.dtype)
    differences[:, 0] = rgb[:, 0]
    np.subtract(rgb[:, 1:], rgb[:, :-1], out=differences[:, 1:])
    return [
        isal_zlib.compress(differences[rows].reshape(-1).view(np.uint8), PACKING)
        for rows in strip_rows(rgb.shape[0], STRIPS)
    ]


def unpack_strip(data: bytes, rgb: Rgb) -> bool:
    """Fill the rows of a strip; return whether the data held them and nothing else.

    Parameters
    ----------
    data : bytes
        Packed.
    rgb : (rows, columns, 3) uint8 or uint16
        Written to; contiguous.
    """
    unpacker = isal_zlib.decompressobj()
    try:
        content = unpacker.decompress(data, rgb.nbytes + 1)
    except isal_zlib.error:  # type: ignore[misc]  # in its stub an instance, in truth a class
        return False
    if len(content) != rgb.nbytes or not unpacker.eof or unpacker.unused_data:
        return False
    _add_up(np.frombuffer(content, rgb.dtype).reshape(rgb.shape), rgb)
    return True


@numba.njit(cache=True, nogil=True)
def _add_up(differences, rgb):  # type: ignore[no-untyped-def]  # pragma: no cover
    """Undo the differences to the left neighbour, modulo the range of the values."""
    for row in range(rgb.shape[0]):
        red, green, blue = differences[row, 0]
        for column in range(rgb.shape[1]):
            if column > 0:
                red += differences[row, column, 0]
                green += differences[row, column, 1]
                blue += differences[row, column, 2]
            rgb[row, column, 0], rgb[row, column, 1], rgb[row, column, 2] = red, green, blue
