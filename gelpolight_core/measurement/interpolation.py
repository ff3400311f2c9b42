"""Values between the nodes of a map."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float64Array


def sample_bilinear(
    values: NDArray[np.floating[Any]], row: Float64Array, column: Float64Array
) -> Float64Array:
    """Return values (..., rows, columns) at fractional rows and columns (N,), bilinear.

    Beyond the map they are those of the nearest node. Faster than SciPy's interpolation of any
    order.
    """
    rows, columns = values.shape[-2:]
    row, column = np.clip(row, 0.0, rows - 1.0), np.clip(column, 0.0, columns - 1.0)
    i = np.minimum(row, rows - 2).astype(np.intp)
    j = np.minimum(column, columns - 2).astype(np.intp)
    flat, first, right = values.reshape(*values.shape[:-2], -1), i * columns + j, column - j
    upper, lower = (
        (1.0 - right) * flat[..., at] + right * flat[..., at + 1] for at in (first, first + columns)
    )
    return np.asarray(upper + (row - i) * (lower - upper))
