"""The cubic spline through heights on a square grid, evaluated anywhere.

Its pieces are bicubic between the nodes and go on beyond the outer ones, as a closed form would.
"""

from __future__ import annotations

import numpy as np

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.compiling import whole

NOT_A_KNOT = (1.0, -4.0, 6.0, -4.0, 1.0)
"""Jump of the third derivative at a node by its five coefficients: 0 next to the outer nodes."""


def spline_coefficients(heights: Float64Array) -> Float64Array:
    """Return the coefficients (n + 2, n + 2) of the B-splines through heights (n, n)."""
    n = len(heights)
    at_nodes = sum(share * np.eye(n, n + 2, k) for k, share in enumerate((1 / 6, 4 / 6, 1 / 6)))
    ends = np.zeros((2, n + 2))
    ends[0, :5] = ends[1, -5:] = NOT_A_KNOT
    inverse = np.linalg.inv(np.vstack([at_nodes, ends]))[:, :n]
    return np.ascontiguousarray(inverse @ heights @ inverse.T)


@whole()
def spline_heights(coefficients: Float64Array, places: Float64Array) -> Float64Array:
    """Return the heights (N,) at places (N, 2): column and row, counted from the first node."""
    heights = np.empty(len(places))
    weights = np.empty((2, 4))
    last = len(coefficients) - 4
    for i in range(len(places)):
        column = min(max(int(places[i, 0]), 0), last)
        row = min(max(int(places[i, 1]), 0), last)
        for axis, first in enumerate((column, row)):
            u = places[i, axis] - first
            v = 1.0 - u
            weights[axis, 0] = v * v * v / 6.0
            weights[axis, 1] = (u * u * (3.0 * u - 6.0) + 4.0) / 6.0
            weights[axis, 2] = (v * v * (3.0 * v - 6.0) + 4.0) / 6.0
            weights[axis, 3] = u * u * u / 6.0
        height = 0.0
        for k in range(4):
            line = 0.0
            for j in range(4):
                line += weights[0, j] * coefficients[row + k, column + j]
            height += weights[1, k] * line
        heights[i] = height
    return heights
