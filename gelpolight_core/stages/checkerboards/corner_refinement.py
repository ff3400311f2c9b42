"""Locate the corners of a checkerboard to a few hundredths of a pixel.

Where four squares meet, the image shows two crossing edges with the same blur. A fit of this model
to the pixels around an approximate corner gives its position, contrast and sharpness together.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.special import erf

from gelpolight_core.base.arrays import Float32Array, Float64Array


@dataclass(frozen=True, slots=True)
class RefinedCorners:
    """Fitted crossings of edges on a grid.

    Attributes
    ----------
    corners_px : (rows, columns, 2)
        (u, v) of the crossing point.
    amplitude : (rows, columns)
        Half of light minus dark; the sign depends on which quadrants are light.
    sigma_px : (rows, columns)
        Standard deviation of the edges' blur.
    """

    corners_px: Float64Array
    amplitude: Float64Array
    sigma_px: Float64Array


@dataclass(frozen=True, slots=True)
class _Window:
    """Pixels (N, P) around corners, their offsets x and y (P), and their weights (N, P)."""

    values: Float64Array
    x: Float64Array
    y: Float64Array
    weights: Float64Array


def refine_corner_grid(grey: Float32Array, rough: Float64Array) -> RefinedCorners:
    """Fit the crossings of a whole grid.

    Parameters
    ----------
    grey : (height, width) float32
        The image, 0..1.
    rough : (rows, columns, 2)
        (u, v) of the corners, to about one pixel.

    Returns
    -------
    RefinedCorners
        The fitted crossings; the caller checks whether they form a checkerboard.
    """
    rows, columns = rough.shape[:2]
    along, down = (np.gradient(rough, axis=axis).reshape(-1, 2) for axis in (1, 0))
    corners, amplitude, sigma = refine_corners(grey, rough.reshape(-1, 2), along, down)
    return RefinedCorners(
        corners.reshape(rows, columns, 2),
        amplitude.reshape(rows, columns),
        sigma.reshape(rows, columns),
    )


def refine_corners(
    grey: Float32Array, rough: Float64Array, along: Float64Array, down: Float64Array
) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Fit two crossing blurred edges to each corner.

    The model around corner c is b + g.x + A erf(n1.(x-c) / s) erf(n2.(x-c) / s), s = sqrt(2)
    sigma: an uneven background, two edges of any direction, one blur. Damped Gauss-Newton on the
    five shape parameters; the four linear ones are solved again in each iteration; all corners at
    once.

    Parameters
    ----------
    grey : (height, width)
        The image.
    rough : (N, 2)
        Start values.
    along, down : (N, 2)
        Steps to the next corner in the row and in the column; these are the directions of the
        edges.

    Returns
    -------
    corners_px : (N, 2)
    amplitude : (N,)
    sigma_px : (N,)
    """
    area = np.abs(along[:, 0] * down[:, 1] - along[:, 1] * down[:, 0])
    longest = np.maximum(np.linalg.norm(along, axis=1), np.linalg.norm(down, axis=1))
    # Up to 1 % of the image, where an edge is still straight despite lens distortion.
    radius = np.clip(0.7 * area / np.maximum(longest, 1e-9), 3.0, max(8.0, grey.shape[1] / 100.0))
    shape = np.empty((len(rough), 5))
    shape[:, :2] = rough
    shape[:, 2] = np.arctan2(along[:, 0], -along[:, 1])
    shape[:, 3] = np.arctan2(down[:, 0], -down[:, 1])
    shape[:, 4] = 1.2
    # First a small window and a common blur, wide enough to converge from a pixel away.
    shape, _ = _fit_shapes(grey, shape, np.minimum(radius, 6.0), free_blur=False)
    shape, amplitude = _fit_shapes(grey, shape, radius, free_blur=True)
    return shape[:, :2], amplitude, shape[:, 4]


def _fit_shapes(
    grey: Float32Array, shape: Float64Array, radius: Float64Array, *, free_blur: bool
) -> tuple[Float64Array, Float64Array]:
    """Return shapes (N, 5), improved in windows until no centre moves, with the amplitudes."""
    origin = np.zeros_like(shape)
    origin[:, :2] = np.round(shape[:, :2])
    window = _cut_windows(grey, origin[:, :2], radius)
    # Bounds keep the first steps, far from the solution, from jumping to a neighbouring corner.
    bound = np.array([1.0, 1.0, 0.2, 0.2, 0.5 if free_blur else 0.0])
    step_scale = np.ones(len(shape))
    local = shape - origin
    step, amplitude, misfit = _propose(local, window, bound)
    for _ in range(12):
        candidate = local + step_scale[:, None] * step
        # A square pixel averages over its area: no edge is sharper than the sd of a unit box.
        candidate[:, 4] = np.clip(candidate[:, 4], 1.0 / math.sqrt(12.0), radius)
        moved_px = np.abs(candidate - local)[:, :2].max()
        new = _propose(candidate, window, bound)
        better = new[2] <= misfit
        step_scale = np.where(better, np.minimum(1.0, 2.0 * step_scale), 0.25 * step_scale)
        local = np.where(better[:, None], candidate, local)
        step = np.where(better[:, None], new[0], step)
        amplitude = np.where(better, new[1], amplitude)
        misfit = np.where(better, new[2], misfit)
        if moved_px < (1e-3 if free_blur else 0.05):
            break
    return origin + local, amplitude


def _cut_windows(grey: Float32Array, origin: Float64Array, radius: Float64Array) -> _Window:
    reach = math.ceil(float(radius.max()))
    y, x = (a.ravel().astype(np.float64) for a in np.mgrid[-reach : reach + 1, -reach : reach + 1])
    in_disc = x * x + y * y <= radius.max() ** 2
    x, y = x[in_disc], y[in_disc]
    u = origin[:, :1] + x
    v = origin[:, 1:] + y
    inside = (u >= 0) & (v >= 0) & (u < grey.shape[1]) & (v < grey.shape[0])
    values = grey[np.where(inside, v, 0).astype(int), np.where(inside, u, 0).astype(int)]
    weights = inside & (x * x + y * y <= radius[:, None] ** 2)
    return _Window(values.astype(np.float64), x, y, weights.astype(np.float64))


def _propose(
    shape: Float64Array, window: _Window, bound: Float64Array
) -> tuple[Float64Array, Float64Array, Float64Array]:
    """Return the Gauss-Newton steps (N, 5), the amplitudes (N,) and the misfits (N,)."""
    surface, slopes = _crossing_model(shape, window.x, window.y)
    ones = np.ones_like(surface)
    basis = np.stack([ones, ones * window.x, ones * window.y, surface], axis=-1)
    linear = _solve(basis, window.weights, window.values)
    residual = window.values - (basis @ linear[..., None])[..., 0]
    free = np.flatnonzero(bound)
    design = np.concatenate([slopes[..., free] * linear[:, None, 3:], basis], axis=-1)
    step = np.zeros_like(shape)
    step[:, free] = _solve(design, window.weights, residual)[:, : len(free)]
    return np.clip(step, -bound, bound), linear[:, 3], np.sum(window.weights * residual**2, axis=1)


def _crossing_model(
    shape: Float64Array, x: Float64Array, y: Float64Array
) -> tuple[Float64Array, Float64Array]:
    """Return erf * erf (N, P) with its derivatives (N, P, 5) by x, y, both angles and blur."""
    cx, cy, angle_1, angle_2, sigma = (column[:, None] for column in shape.T)
    dx, dy = x - cx, y - cy
    cos_1, sin_1, cos_2, sin_2 = np.cos(angle_1), np.sin(angle_1), np.cos(angle_2), np.sin(angle_2)
    distance_1, distance_2 = cos_1 * dx + sin_1 * dy, cos_2 * dx + sin_2 * dy
    edge_1, edge_2 = (
        erf(distance_1 / (math.sqrt(2.0) * sigma)),
        erf(distance_2 / (math.sqrt(2.0) * sigma)),
    )
    peak = math.sqrt(2.0 / math.pi) / sigma
    steep_1 = peak * np.exp(-0.5 * (distance_1 / sigma) ** 2) * edge_2
    steep_2 = peak * np.exp(-0.5 * (distance_2 / sigma) ** 2) * edge_1
    slopes = (
        -(steep_1 * cos_1 + steep_2 * cos_2),
        -(steep_1 * sin_1 + steep_2 * sin_2),
        steep_1 * (cos_1 * dy - sin_1 * dx),
        steep_2 * (cos_2 * dy - sin_2 * dx),
        -(steep_1 * distance_1 + steep_2 * distance_2) / sigma,
    )
    return edge_1 * edge_2, np.stack(slopes, axis=-1)


def _solve(basis: Float64Array, weights: Float64Array, values: Float64Array) -> Float64Array:
    """Weighted least squares of (N, P) values in a basis (N, P, K): (N, K)."""
    transposed = np.swapaxes(basis * weights[..., None], 1, 2)
    normal = transposed @ basis
    # The ridge is negligible for a visible corner and keeps an invisible one from stopping the
    # rest.
    scale = np.trace(normal, axis1=1, axis2=2)[:, None, None]
    normal = normal + (1e-12 * scale + 1e-12) * np.eye(basis.shape[2])
    return np.asarray(np.linalg.solve(normal, transposed @ values[..., None])[..., 0])
