"""Read NumPy files from unknown sources: every size is checked before memory is allocated."""

from __future__ import annotations

import io
import math
import re
import tokenize
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib import format as npy
from numpy.typing import NDArray

from gelpolight_core.io.reading import opened_zip, read_member, refuse_bomb

HEAD_LIMIT = 10_000
KINDS = re.compile(r"<[fi][48]|\|u1|<U\d{1,5}")
"""Numbers and texts as this program writes them, little-endian."""
MOST_DIMENSIONS = 4


def read_arrays(path: Path, names: Collection[str]) -> dict[str, NDArray[Any]]:
    """Return the arrays of these names that an ``.npz`` file contains.

    Raises
    ------
    FileNotFoundError, InputError
        See :func:`~gelpolight_core.io.reading.open_file`.
    ValueError
        If it is not such a file, is damaged, or declares more than a file of its size can contain.
    """
    with opened_zip(path) as archive:
        stored = {info.filename: info for info in archive.infolist()}
        members = {name: stored[f"{name}.npy"] for name in names if f"{name}.npy" in stored}
        refuse_bomb(members.values())
        return {
            name: array_of(read_member(archive, info.filename, info.file_size))
            for name, info in members.items()
        }


def array_of(data: bytes) -> NDArray[Any]:
    """Return the array of an ``.npy`` file of numbers or texts, little-endian.

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
    if not KINDS.fullmatch(kind.str) or len(shape) > MOST_DIMENSIONS:
        raise ValueError(f"an array has the type {kind.str[:40]} and {len(shape)} dimensions")
    offset = stream.tell()
    if min(shape, default=0) < 0 or math.prod(shape) * kind.itemsize != len(data) - offset:
        raise ValueError("an array has another size than its header declares")
    return np.frombuffer(data, kind, offset=offset).reshape(shape, order="F" if by_columns else "C")
