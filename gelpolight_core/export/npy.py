"""NumPy files from elsewhere: their head is compared with what may come before memory is taken."""

from __future__ import annotations

import io
import math
import tokenize
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

HEAD_LIMIT = 10_000
KINDS = ("<f4", "<f8")
MOST_DIMENSIONS = 4


def array_of(data: bytes) -> NDArray[Any]:
    """Return the array of an ``.npy`` file of float32 or float64, little-endian, in C order.

    ``numpy.load`` takes memory for whatever size the head declares, and its parser fails in many
    ways; here the head must declare just what follows it.

    Raises
    ------
    ValueError
        If the bytes are no such file, or are not as many as the head declares.
    """
    stream = io.BytesIO(data)
    try:
        if npy.read_magic(stream) not in ((1, 0), (2, 0)):
            raise ValueError("an array of another version")
        read = npy.read_array_header_1_0 if data[6] == 1 else npy.read_array_header_2_0
        shape, by_columns, kind = read(stream, max_header_size=HEAD_LIMIT)
    except (SyntaxError, tokenize.TokenError, RecursionError, MemoryError, TypeError) as error:
        raise ValueError("the head of an array is damaged") from error
    if by_columns or kind.str not in KINDS or len(shape) > MOST_DIMENSIONS:
        raise ValueError(f"an array is {kind.str[:40]} of {len(shape)} dimensions")
    place = stream.tell()
    if min(shape, default=0) < 0 or math.prod(shape) * kind.itemsize != len(data) - place:
        raise ValueError("an array declares another size than it has")
    return np.frombuffer(data, kind, offset=place).reshape(shape)
