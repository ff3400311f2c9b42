"""Fit of a ball's shading to an image, which finds the ball and excludes other objects.

Around a ball, the slopes of the membrane have all directions. They increase from the middle to the
contact's edge and decrease in the drape. Whatever the lights, a channel's brightness is a smooth
function of slope, here a polynomial of degree 2 whose coefficients are free for each channel. The
only shape parameters of the fit are those of the ball: centre, contact radius and decay length. All
pixels contribute, and pixels without a value are left out. The residual of this fit distinguishes a
ball from other objects.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from gelpolight_core.base.arrays import BoolArray, Float32Array, Float64Array

from .contact_contour import ImageCircle

BALL_EXPLAINED = 0.55
"""The shading of a ball explains 0.66 to 0.99 of the change around it, including texture and
shadows."""
_REACH = 2.2
_STEPS = 12
_COARSE, _FINE = 0.02, 0.004
_ROBUST = 0.3
_INNER = 0.6
_STARTS = ((0.75, 0.4), (0.5, 0.4))


@dataclass(frozen=True, slots=True)
class ShadingFit:
    """Fit of a ball's shading: its circle, its shape and the explained share of the image.

    Attributes
    ----------
    circle : ImageCircle
        The contact's edge, pixels.
    centre_sd_px : float
        Standard deviation of the centre per axis that follows from what is left unexplained.
    axis_ratio : float
        Shorter over longer axis, if the ball is fitted as an ellipse.
    stretch : float
        Logarithm of the axis along y over the axis along x of that ellipse.
    explained : float
        Share of the change of brightness that the ball's shading explains, 0..1, without noise.
    inner_change : float
        Change of brightness across the inner half over that of the fit: 1 for a ball, near 0 for
        a flat face.
    """

    circle: ImageCircle
    centre_sd_px: float
    axis_ratio: float
    stretch: float
    explained: float
    inner_change: float


def fit_shading(
    change: Float32Array,
    usable: BoolArray,
    start: ImageCircle,
    *,
    noise: float = 0.0,
    largest_px: float = np.inf,
) -> ShadingFit | None:
    """Fit a ball's shading to the change of brightness around a rough circle.

    Parameters
    ----------
    change : (rows, columns, 3)
        Relative change against the background, such as the logarithm of their ratio.
    usable : (rows, columns) bool
        Which pixels count.
    start : ImageCircle
        Rough circle about the contact and part of its drape.
    noise : float, optional
        Standard deviation of `change` per pixel without contact.
    largest_px : float, optional
        The contact's radius is not larger than this: nearly the ball's, if that is known.

    Returns
    -------
    ShadingFit or None
        None where too few pixels are usable.
    """
    x, y, values = _gather(change, usable, start)
    if len(x) < 60:
        return None
    scale = _ROBUST * float(np.sqrt(np.mean(values**2))) + 1e-9
    fitted = _fit_best(_Pixels(x, y, values, scale, largest_px, False), start, noise)
    if fitted.explained < BALL_EXPLAINED:
        # On sensors with light from all sides, brightness depends on depth, too.
        fitted_with_depth = _fit_best(_Pixels(x, y, values, scale, largest_px, True), start, noise)
        return fitted_with_depth if fitted_with_depth.explained > BALL_EXPLAINED else fitted
    return fitted


def _fit_best(pixels: _Pixels, start: ImageCircle, noise: float) -> ShadingFit:
    """Fit from a large and a small circle, continue with the better one, then as an ellipse."""
    radius = start.radius
    starts = [_descend(pixels, _first(pixels, start, *s), radius, 4, _COARSE) for s in _STARTS]
    best = min((_reweighted(pixels, f) for f in starts), key=lambda f: f.cost)
    for tolerance in (_COARSE, _FINE):
        best = _reweighted(pixels, _descend(pixels, best, radius, 4, tolerance))
    ellipse = _descend(pixels, best, radius, 6, _COARSE)
    return _describe(best, ellipse, pixels, noise)


@dataclass(frozen=True, slots=True)
class _ShadingSolution:
    shape: Float64Array
    """cx, cy, log radius, log decay, and the ellipse: along the axes and along the diagonals."""
    root: Float64Array
    """Roots of the weights (channels, pixels)."""
    residual: Float64Array
    """Weighted (channels, pixels)."""
    coefficients: Float64Array
    """(terms, channels)."""
    cost: float
    design: Float64Array
    """(pixels, terms)."""


@dataclass(frozen=True, slots=True)
class _Pixels:
    x: Float64Array
    y: Float64Array
    values: Float64Array
    scale: float
    largest: float
    by_depth: bool


def _gather(
    change: Float32Array, usable: BoolArray, start: ImageCircle
) -> tuple[Float64Array, Float64Array, Float64Array]:
    reach = _REACH * start.radius
    rows, columns = usable.shape
    top, bottom = max(int(start.y - reach), 0), min(int(start.y + reach) + 1, rows)
    left, right = max(int(start.x - reach), 0), min(int(start.x + reach) + 1, columns)
    window = usable[top:bottom, left:right]
    # At most about 1500 pixels.
    stride = max(1, int(np.sqrt(window.size * np.pi / 4.0 / 1500)))
    y, x = np.mgrid[top:bottom:stride, left:right:stride]
    values_near = change[top:bottom:stride, left:right:stride]
    in_reach = (np.hypot(x - start.x, y - start.y) < reach) & window[::stride, ::stride]
    in_reach &= np.isfinite(values_near).all(axis=-1)
    values = values_near[in_reach].astype(np.float64)
    return x[in_reach].astype(np.float64), y[in_reach].astype(np.float64), values


def _basis(x: Float64Array, y: Float64Array, shape: Float64Array, by_depth: bool) -> Float64Array:
    """Return (N, 5): slope x and y and their products, 1 at the edge, or (N, 6) with depth."""
    dx, dy = x - shape[0], y - shape[1]
    # Slopes keep their direction in the stretched frame, which is accurate enough for the axis
    # ratio.
    dx, dy = (1.0 + shape[4]) * dx + shape[5] * dy, shape[5] * dx + (1.0 - shape[4]) * dy
    radius, decay = np.exp(shape[2]), np.exp(shape[3])
    r = np.sqrt(dx * dx + dy * dy)
    fall = np.exp(-np.maximum(r - radius, 0.0) / decay)
    outside = fall / np.maximum(r, radius)
    p, q = outside * dx, outside * dy
    if not by_depth:
        return np.stack([p, q, p * p, p * q, q * q], axis=1)
    # The integral of the slope inwards: the drape's, and inside the contact the ball's as well.
    depth = fall * (decay / radius) + 0.5 * np.maximum(1.0 - (r / radius) ** 2, 0.0)
    return np.stack([p, q, p * p, p * q, q * q, depth], axis=1)


def _first(pixels: _Pixels, start: ImageCircle, part: float, decay: float) -> _ShadingSolution:
    size = np.log(min(part * start.radius, 0.9 * pixels.largest))
    shape = np.array([start.x, start.y, size, size + np.log(decay), 0.0, 0.0])
    return _solve(pixels, np.ones(pixels.values.shape[::-1]), shape)


def _reweighted(pixels: _Pixels, solution: _ShadingSolution) -> _ShadingSolution:
    """Return the solution with Cauchy weights that follow from its residuals."""
    residual = pixels.values - solution.design @ solution.coefficients
    root = 1.0 / np.sqrt(1.0 + (residual.T / pixels.scale) ** 2)
    return _solve(pixels, root, solution.shape)


def _descend(
    pixels: _Pixels, best: _ShadingSolution, radius: float, free: int, tol: float
) -> _ShadingSolution:
    """Take Levenberg-Marquardt steps in the first `free` of the shape's parameters.

    Stops when a step moves the circle by less than `tol` of the radius.
    """
    largest = np.log(min(1.8 * radius, pixels.largest))
    low = np.array([-np.inf, -np.inf, np.log(0.2 * radius), np.log(0.05 * radius), -0.5, -0.5])
    high = np.array([np.inf, np.inf, largest, np.log(1.5 * radius), 0.5, 0.5])
    typical_step = np.array([radius, radius, 1.0, 10.0, 1.0, 1.0])[:free]
    limit = np.array([0.4 * radius, 0.4 * radius, 0.3, 0.7, 0.1, 0.1])[:free]
    damping = 1e-2
    jacobian = _jacobian(pixels, best, free)
    for _ in range(_STEPS):
        normal = jacobian.T @ jacobian
        normal += damping * np.diag(np.diag(normal) + 1e-12)
        gradient = jacobian.T @ best.residual.ravel()
        change = np.clip(np.linalg.solve(normal, -gradient), -limit, limit)
        shape = best.shape.copy()
        shape[:free] += change
        candidate = _solve(pixels, best.root, np.clip(shape, low, high))
        if (candidate.residual**2).sum() < (best.residual**2).sum():
            best, damping = candidate, 0.3 * damping
            if bool((np.abs(change) < tol * typical_step).all()):
                break
            jacobian = _jacobian(pixels, best, free)
        else:
            damping *= 6.0
            if damping > 1e3:
                break
    return best


def _solve(pixels: _Pixels, root: Float64Array, shape: Float64Array) -> _ShadingSolution:
    """Solve for the coefficients of each channel at a given shape."""
    design = _basis(pixels.x, pixels.y, shape, pixels.by_depth)
    weighted = design[None] * root[..., None]
    values = np.asarray(pixels.values.T * root)
    normal = weighted.transpose(0, 2, 1) @ weighted + _ridge(design)
    moments = weighted.transpose(0, 2, 1) @ values[..., None]
    solution = np.linalg.solve(normal, moments)
    residual = np.asarray(values - (weighted @ solution)[..., 0])
    coefficients = np.asarray(solution[..., 0].T, np.float64)
    cost = float(np.log1p(((residual / root) / pixels.scale) ** 2).sum())
    return _ShadingSolution(shape, root, residual, coefficients, cost, design)


def _ridge(design: Float64Array) -> Float64Array:
    return np.asarray(1e-6 * len(design) * np.eye(design.shape[1]))


def _jacobian(pixels: _Pixels, fit: _ShadingSolution, free: int) -> Float64Array:
    """Return the derivatives of the residuals by the shape (variable projection, Kaufman, 1975)."""
    radius = float(np.exp(fit.shape[2]))
    steps = np.array([1e-3 * radius, 1e-3 * radius, 1e-3, 1e-3, 1e-3, 1e-3])
    weighted = fit.design[None] * fit.root[..., None]
    changes = np.empty((*fit.residual.shape, free))
    for i in range(free):
        shape = fit.shape.copy()
        shape[i] += steps[i]
        slope = (_basis(pixels.x, pixels.y, shape, pixels.by_depth) - fit.design) / steps[i]
        changes[..., i] = (slope @ fit.coefficients).T * fit.root
    normal = weighted.transpose(0, 2, 1) @ weighted + _ridge(fit.design)
    inside = np.linalg.solve(normal, weighted.transpose(0, 2, 1) @ changes)
    return np.asarray((weighted @ inside - changes).reshape(-1, free))


def _describe(
    best: _ShadingSolution, ellipse: _ShadingSolution, pixels: _Pixels, noise: float
) -> ShadingFit:
    values = pixels.values
    circle = ImageCircle(float(best.shape[0]), float(best.shape[1]), float(np.exp(best.shape[2])))
    residual = values - best.design @ best.coefficients
    floor = noise**2 * values.size
    signal = max(float((values**2).sum()) - floor, 1e-12)
    unexplained = max(float((residual**2).sum()) - floor, 0.0)
    stretch = min(float(np.hypot(ellipse.shape[4], ellipse.shape[5])), 0.9)
    # Residuals of a smooth misfit are correlated over a fraction of the radius: there are far fewer
    # independent residuals than pixels.
    spacing = np.sqrt(np.pi * (_REACH * circle.radius) ** 2 / len(values))
    share = min(1.0, (spacing / (0.25 * circle.radius)) ** 2)
    variance = float((best.residual**2).mean()) / max(share, 1e-6)
    jacobian = _jacobian(pixels, best, 4)
    covariance = variance * np.linalg.pinv(jacobian.T @ jacobian)
    sd = float(np.sqrt(0.5 * np.trace(covariance[:2, :2])))
    return ShadingFit(
        circle,
        sd,
        float((1.0 - stretch) / (1.0 + stretch)),
        float(2.0 * np.arctanh(np.clip(ellipse.shape[4], -0.9, 0.9))),
        1.0 - unexplained / signal,
        _inner_change(pixels, best),
    )


def _inner_change(pixels: _Pixels, best: _ShadingSolution) -> float:
    """Return the slope of the measured over the fitted change, within the inner half."""
    radius = float(np.exp(best.shape[2]))
    inner = np.hypot(pixels.x - best.shape[0], pixels.y - best.shape[1]) < _INNER * radius
    if np.count_nonzero(inner) < 12:
        return 1.0
    fitted = (best.design @ best.coefficients)[inner]
    measured = pixels.values[inner]
    fitted = fitted - fitted.mean(axis=0)
    return float((fitted * measured).sum() / max(float((fitted**2).sum()), 1e-12))
