"""Least squares within bounds, for many residuals and few parameters."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from .arrays import BoolArray, Float64Array

Bounds = tuple[Float64Array, Float64Array]

TOLERANCE = 1e-6
MOST_STEPS = 60
_LEAST_CURVATURE = np.finfo(np.float64).eps


@dataclass(frozen=True, slots=True)
class LeastSquares:
    """Result of a fit.

    Attributes
    ----------
    x : (n,)
        The parameters.
    slopes : (m, n) or None
        Jacobian of the residuals before the last step; None for a robust fit, which weights it.
    converged : bool
        Whether the fit converged before the limit on the number of steps.
    """

    x: Float64Array
    slopes: Float64Array | None
    converged: bool


def fit_least_squares(
    residuals: Callable[[Float64Array], Float64Array],
    jacobian: Callable[[Float64Array], Float64Array],
    start: Float64Array,
    bounds: Bounds,
    *,
    scale: Float64Array | None = None,
    robust: bool | BoolArray = False,
    tolerance: float = TOLERANCE,
) -> LeastSquares:
    r"""Minimise a sum of squares within bounds, by damped Gauss-Newton steps.

    The normal equations have one row per parameter, so a step costs little compared with the
    residuals; a decomposition of the whole Jacobian would take ten times as long.

    Parameters
    ----------
    residuals : callable
        Maps parameters (n,) to residuals (m,), divided by their standard deviations.
    jacobian : callable
        Maps parameters (n,) to the Jacobian of the residuals (m, n), a new array each time.
    start : (n,)
        First guess, within the bounds.
    bounds : ((n,), (n,))
        Lower and upper bounds; infinite where there is no bound.
    scale : (n,), optional
        Typical change of each parameter; by default chosen so that each parameter changes the
        residuals at `start` equally.
    robust : bool or (m,) bool, optional
        Minimise the sum of :math:`\sqrt{1 + r^2} - 1` instead of :math:`r^2 / 2`, for all residuals
        or for some.
    tolerance : float, optional
        The fit ends when a step lowers the cost, or moves the parameters, by less than this
        fraction.

    References
    ----------
    K. Madsen, H. B. Nielsen, O. Tingleff, "Methods for non-linear least squares problems", 2004,
    section 3.2; the robust loss and its curvature as in scipy.optimize.least_squares.
    """
    lower_bound, upper_bound = bounds
    x = np.clip(start, lower_bound, upper_bound)
    residual = residuals(x)
    cost = _cost(residual, robust)
    slopes = jacobian(x)
    curvature, gradient = _normal_equations(slopes, residual, robust)
    if scale is None:
        scale = 1.0 / np.sqrt(np.where(np.diag(curvature) > 0.0, np.diag(curvature), 1.0))
    damping, growth = 1e-3 * float(np.max(np.diag(curvature) * scale**2)), 2.0
    converged = False
    for _ in range(MOST_STEPS):
        damped = curvature + np.diag(damping / scale**2)
        step = _step(damped, gradient, lower_bound - x, upper_bound - x)
        candidate = np.clip(x + step, lower_bound, upper_bound)
        step = candidate - x
        expected = -float(gradient @ step + 0.5 * step @ curvature @ step)
        residual = residuals(candidate)
        decrease = cost - _cost(residual, robust)
        small = float(np.linalg.norm(step / scale)) <= tolerance * float(np.linalg.norm(x / scale))
        if decrease > 0.0:
            x, cost = candidate, cost - decrease
            if small or decrease < tolerance * cost:
                converged = True
                break
            ratio = decrease / expected if expected > 0.0 else 0.0
            damping *= max(1.0 / 3.0, 1.0 - (2.0 * ratio - 1.0) ** 3)
            growth = 2.0
            slopes = jacobian(x)
            curvature, gradient = _normal_equations(slopes, residual, robust)
        elif small:
            converged = True
            break
        else:
            damping *= growth
            growth *= 2.0
    return LeastSquares(x, None if np.any(robust) else slopes, converged)


def _cost(residual: Float64Array, robust: bool | BoolArray) -> float:
    if not np.any(robust):
        return 0.5 * float(residual @ residual)
    soft = np.sqrt(1.0 + residual**2) - 1.0
    return float(np.sum(np.where(robust, soft, 0.5 * residual**2)))


def _normal_equations(
    slopes: Float64Array, residual: Float64Array, robust: bool | BoolArray
) -> tuple[Float64Array, Float64Array]:
    """Return curvature (n, n) and gradient (n,) of the cost, perhaps overwriting `slopes`."""
    if not np.any(robust):
        return slopes.T @ slopes, slopes.T @ residual
    z = np.where(robust, 1.0 + residual**2, 1.0)
    gradient = slopes.T @ (residual / np.sqrt(z))
    slopes *= np.sqrt(np.maximum(z**-1.5, _LEAST_CURVATURE))[:, None]
    return slopes.T @ slopes, gradient


def _step(
    curvature: Float64Array, gradient: Float64Array, low: Float64Array, high: Float64Array
) -> Float64Array:
    """Return the step (n,) to the minimum of a quadratic, stopped at the bounds."""
    step = np.zeros(gradient.size)
    free = ~((low >= 0.0) & (gradient > 0.0) | (high <= 0.0) & (gradient < 0.0))
    while free.any():
        slope = gradient[free] + curvature[np.ix_(free, ~free)] @ step[~free]
        step[free] = np.linalg.solve(curvature[np.ix_(free, free)], -slope)
        crossing = free & ((step < low) | (step > high))
        if not crossing.any():
            break
        step[crossing] = np.clip(step, low, high)[crossing]
        free &= ~crossing
    return step
