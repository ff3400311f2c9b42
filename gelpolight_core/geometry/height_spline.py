"""The cubic spline through heights on a square grid, evaluated anywhere.

Its pieces are bicubic between the nodes, and the outer ones go on, as a closed form would.
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
    last = len(coefficients) - 4
    per_length, middle = (last + 1) / width, 0.5 * (last + 1)
    for i in range(len(x)):
        x_place, y_place = x[i] * per_length + middle, y[i] * per_length + middle
        column = min(max(int(x_place), 0), last)
        row = min(max(int(y_place), 0), last)
        a, b, c, d = _weights(x_place - column)
        height = 0.0
        for k, weight in enumerate(_weights(y_place - row)):
            line = coefficients[row + k, column : column + 4]
            height += weight * (a * line[0] + b * line[1] + c * line[2] + d * line[3])
        heights[i] = height
    return heights


@part()
def _weights(u: float) -> tuple[float, float, float, float]:
    """Return the weights of four coefficients at a share of the way from the second to the next."""
    v = 1.0 - u
    b, c = u * u * (3.0 * u - 6.0) + 4.0, v * v * (3.0 * v - 6.0) + 4.0
    return v * v * v / 6.0, b / 6.0, c / 6.0, u * u * u / 6.0
