"""Fits of circles, spheres and planes to points, and robust scales and weights for all fits."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.arrays import Array, Mask

SD_OF_MEDIAN = 1.4826
"""Standard deviation of normal errors over the median of their absolute values."""
TUKEY = 4.7
"""Errors in standard deviations from which Tukey's weight is 0: normal errors lose 5 % of their
information."""


def robust_sd(errors: NDArray[np.floating]) -> float:
    """Return the standard deviation about 0 of errors that are normal, but for outliers."""
    return SD_OF_MEDIAN * float(np.median(np.abs(errors)))


def tukey_weights(errors: NDArray[np.floating], cutoff: float) -> Array:
    """Return Tukey's biweight, which is 0 for errors beyond the cut-off."""
    return np.asarray(np.clip(1.0 - (errors / cutoff) ** 2, 0.0, None) ** 2)


def robust_fit(errors: Callable[[Array], Array], start: Array, sd: float | None = None) -> Array:
    """Return the parameters with the least errors, of which large ones count linearly.

    Parameters
    ----------
    errors : callable
        Maps parameters (n,) to errors (m,).
    start : (n,)
        First guess.
    sd : float, optional
        From how large an error on it counts linearly; by default the robust standard deviation at
        `start`, but at least 1e-6.
    """
    from scipy.optimize import least_squares  # slow to import

    scale = max(robust_sd(errors(start)), 1e-6) if sd is None else sd
    return np.asarray(least_squares(errors, start, loss="soft_l1", f_scale=scale).x)


def circle_errors(points: Array) -> Callable[[Array], Array]:
    """Return the function from a circle (x, y, radius) to the distances (N,) of points from it."""
    return lambda circle: np.asarray(
        np.hypot(points[:, 0] - circle[0], points[:, 1] - circle[1]) - circle[2]
    )


def algebraic_sphere(points: Array) -> tuple[Array, float]:
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


def fit_plane(x: Array, y: Array, z: Array) -> tuple[float, float, float]:
    """Return the least-squares plane: level at the mean point, slopes along x and y."""
    u, v = x - x.mean(), y - y.mean()
    terms = np.stack([np.ones_like(u), u, v], axis=1)
    level, slope_x, slope_y = np.linalg.lstsq(terms, z)[0].tolist()
    return level, slope_x, slope_y


def above_plane(x: Array, y: Array, z: Array, around: Mask | None = None) -> Array:
    """Return z of points above the least-squares plane of those `around` (all)."""
    selected = np.s_[:] if around is None else around
    level, slope_x, slope_y = fit_plane(x[selected], y[selected], z[selected])
    u, v = x - x[selected].mean(), y - y[selected].mean()
    return np.asarray(z - (level + slope_x * u + slope_y * v))
