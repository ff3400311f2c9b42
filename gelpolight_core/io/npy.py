"""Read NumPy files from unknown sources: the header is checked before memory is allocated."""

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

    ``numpy.load`` allocates memory for any size that the header declares, and its parser can fail
    in many ways; here the header must declare exactly the data that follows it.

    Raises
    ------
    ValueError
        If the bytes are not such a file, or their number differs from the header.
    """
    stream = io.BytesIO(data)
    try:
        if npy.read_magic(stream) not in ((1, 0), (2, 0)):
            raise ValueError("an array has an unknown version")
        read = npy.read_array_header_1_0 if data[6] == 1 else npy.read_array_header_2_0
        shape, by_columns, kind = read(stream, max_header_size=HEAD_LIMIT)
    except (SyntaxError, tokenize.TokenError, RecursionError, MemoryError, TypeError) as error:
        raise ValueError("the header of an array is damaged") from error
    if by_columns or kind.str not in KINDS or len(shape) > MOST_DIMENSIONS:
        raise ValueError(f"an array has the type {kind.str[:40]} and {len(shape)} dimensions")
    offset = stream.tell()
    if min(shape, default=0) < 0 or math.prod(shape) * kind.itemsize != len(data) - offset:
        raise ValueError("an array has another size than its header declares")
    return np.frombuffer(data, kind, offset=offset).reshape(shape)
