"""The cubic spline through heights on a square grid, evaluated anywhere.

Its pieces are bicubic between the nodes and go on beyond the outer ones, as a closed form would.
"""

from __future__ import annotations

import numpy as np

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.compiling import part, whole

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
def spline_heights(
    coefficients: Float64Array, width: float, x: Float64Array, y: Float64Array
) -> Float64Array:
    """Return the heights (N,) at x and y (N,) from the middle of the square grid."""
    heights = np.empty(len(x))
    x_weights, y_weights = np.empty(4), np.empty(4)
    last = len(coefficients) - 4
    per_length, middle = (last + 1) / width, 0.5 * (last + 1)
    for i in range(len(x)):
        column = _weigh(x[i] * per_length + middle, last, x_weights)
        row = _weigh(y[i] * per_length + middle, last, y_weights)
        height = 0.0
        for k in range(4):
            line = 0.0
            for j in range(4):
                line += x_weights[j] * coefficients[row + k, column + j]
            height += y_weights[k] * line
        heights[i] = height
    return heights


@part()
def _weigh(place: float, last: int, weights: Float64Array) -> int:
    """Return the first of the four coefficients at a place, and fill in their weights (4,)."""
    first = min(max(int(place), 0), last)
    u = place - first
    v = 1.0 - u
    weights[0] = v * v * v / 6.0
    weights[1] = (u * u * (3.0 * u - 6.0) + 4.0) / 6.0
    weights[2] = (v * v * (3.0 * v - 6.0) + 4.0) / 6.0
    weights[3] = u * u * u / 6.0
    return first
