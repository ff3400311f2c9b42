"""Fits of circles, spheres and planes to points."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from gelpolight_core.base.arrays import BoolArray, Float64Array


def circle_errors(points: Float64Array) -> Callable[[Float64Array], Float64Array]:
    """Return the function from a circle (x, y, radius) to the distances (N,) of points from it."""
    return lambda circle: np.asarray(
        np.hypot(points[:, 0] - circle[0], points[:, 1] - circle[1]) - circle[2]
    )


def algebraic_sphere(points: Float64Array) -> tuple[Float64Array, float]:
    """Return middle (D,) and radius of the circle or sphere near points (N, D), in closed form.

    The least squares of ``x^2 + y^2 - (2 a x + 2 b y + c)``. The points should be around 0.

    References
    ----------
    I. Kasa, "A circle fitting procedure and its error analysis", IEEE Transactions on
    Instrumentation and Measurement 25, 1976.
    """
    terms = np.column_stack([2.0 * points, np.ones(len(points))])
    solution = np.linalg.lstsq(terms, (points**2).sum(axis=1), rcond=None)[0]
    square = float(solution[-1])
    for coordinate in solution[:-1].tolist():
        square += coordinate**2
    return solution[:-1], math.sqrt(max(square, 0.0))


def fit_plane(x: Float64Array, y: Float64Array, z: Float64Array) -> tuple[float, float, float]:
    """Return the least-squares plane: level at the mean point, slopes along x and y."""
    u, v = x - x.mean(), y - y.mean()
    terms = np.stack([np.ones_like(u), u, v], axis=1)
    level, slope_x, slope_y = np.linalg.lstsq(terms, z)[0].tolist()
    return level, slope_x, slope_y


def above_plane(
    x: Float64Array, y: Float64Array, z: Float64Array, around: BoolArray | None = None
) -> Float64Array:
    """Return z of points above the least-squares plane of those `around` (all)."""
    selected = np.s_[:] if around is None else around
    level, slope_x, slope_y = fit_plane(x[selected], y[selected], z[selected])
    u, v = x - x[selected].mean(), y - y[selected].mean()
    return np.asarray(z - (level + slope_x * u + slope_y * v))
