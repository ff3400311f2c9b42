"""Read NumPy files from unknown sources: every size is checked before memory is allocated."""

from __future__ import annotations

import math
import re
from collections.abc import Collection
from pathlib import Path
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from .safe_reading import open_zip, read_member

HEAD_BYTES = {b"\x93NUMPY\x01\0": 2, b"\x93NUMPY\x02\0": 4}
"""Bytes of the header's length, by the mark and version before it."""
HEAD = re.compile(
    rb"\{'descr': '(<[fi][48]|\|u1|<U\d{1,5})', 'fortran_order': (True|False),"
    rb" 'shape': \(((?:\d{1,12},? ?){0,4})\), \} *\n"
)
"""As NumPy writes it: numbers or texts, little-endian, of at most four dimensions."""


def read_arrays(path: Path, names: Collection[str]) -> dict[str, NDArray[Any]]:
    """Return the arrays of these names that an ``.npz`` file contains.

    Raises
    ------
    FileNotFoundError, InputError
        See :func:`~gelpolight_core.base.safe_reading.open_file`.
    ValueError
        If it is not such a file, is damaged, or declares more than a file of its size can contain.
    """
    with open_zip(path) as archive:
        stored = {info.filename: info.file_size for info in archive.infolist()}
        members = {name: f"{name}.npy" for name in names if f"{name}.npy" in stored}
        return {
            name: array_of(read_member(archive, member, stored[member]))
            for name, member in members.items()
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
    begin = 8 + HEAD_BYTES.get(data[:8], 0)
    end = begin + int.from_bytes(data[8:begin], "little")
    head = HEAD.fullmatch(data, begin, end)
    if head is None:
        raise ValueError("the header of an array is damaged, or of an unknown type or version")
    kind, shape = np.dtype(head[1].decode()), tuple(map(int, re.findall(rb"\d+", head[3])))
    if math.prod(shape) * kind.itemsize != len(data) - end:
        raise ValueError("an array has another size than its header declares")
    order: Literal["F", "C"] = "F" if head[2] == b"True" else "C"
    return np.frombuffer(data, kind, offset=end).reshape(shape, order=order)
