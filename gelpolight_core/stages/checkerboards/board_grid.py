"""Check that fitted corners form a whole checkerboard on a perspective grid."""

from __future__ import annotations

import math
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array, Float64Array

from .corner_refinement import RefinedCorners, refine_corners

# A real crossing has the amplitude of its neighbours (1); the end of a single edge has half.
MIN_CROSSING = 0.75


def is_checkered(grey: Float32Array, grid: RefinedCorners) -> bool:
    """Whether corners alternate in sign and the border rows are as strong as their neighbours.

    Parameters
    ----------
    grey : (height, width) float32
        The image.
    grid : RefinedCorners
        The corners fitted in it.
    """
    rows, columns = grid.amplitude.shape
    signed = grid.amplitude * (1 - 2 * (np.add.outer(np.arange(rows), np.arange(columns)) % 2))
    signed = signed * np.sign(np.median(signed))
    if not (signed > 0.0).all():
        return False
    if _mixed_squares(grey, grid):
        return False
    sides = [(signed[0], signed[1]), (signed[-1], signed[-2])]
    sides += [(signed[:, 0], signed[:, 1]), (signed[:, -1], signed[:, -2])]
    return all(float(np.median(outer / inner)) > MIN_CROSSING for outer, inner in sides)


def _mixed_squares(grey: Float32Array, grid: RefinedCorners) -> bool:
    """Whether grid cells contain both light and dark, because the detector skipped corners."""
    t = np.linspace(0.2, 0.8, 7)
    right, down = (a.reshape(-1, 1, 1, 1) for a in np.meshgrid(t, t))
    c = grid.corners_px
    upper = (1.0 - right) * c[:-1, :-1] + right * c[:-1, 1:]
    lower = (1.0 - right) * c[1:, :-1] + right * c[1:, 1:]
    points = np.round((1.0 - down) * upper + down * lower).astype(int)
    u, v = (np.clip(points[..., k], 0, grey.shape[1 - k] - 1) for k in (0, 1))
    sd = grey[v, u].std(axis=0) / (2.0 * np.abs(grid.amplitude[:-1, :-1]))
    # A single square is uniform (0); half light and half dark has half the contrast.
    return bool(np.median(sd) > 0.25)


def continues_beyond_grid(grey: Float32Array, grid: RefinedCorners) -> bool:
    """Whether the checkerboard continues with another row or column beyond the grid.

    Parameters
    ----------
    grey : (height, width) float32
        The image.
    grid : RefinedCorners
        The corners fitted in it.
    """
    return any(
        _has_next_row(
            grey, np.rot90(grid.corners_px, quarter_turns), np.rot90(grid.amplitude, quarter_turns)
        )
        for quarter_turns in range(4)
    )


def _has_next_row(grey: Float32Array, corners: Float64Array, amplitude: Float64Array) -> bool:
    rows, columns = corners.shape[:2]
    x, y = np.meshgrid(np.arange(columns, dtype=np.float64), np.arange(rows, dtype=np.float64))
    matrix, _ = cv2.findHomography(np.stack([x, y], -1).reshape(-1, 2), corners.reshape(-1, 2))
    residual = corners - apply_homography(matrix, x, y)
    # Distortion bends the grid slowly: the misfit at the border continues outwards.
    next_row = apply_homography(matrix, x[0], y[0] - 1.0) + 2.0 * residual[0] - residual[1]
    step = corners[0] - next_row
    # A quarter of a square around a corner must be in the image to detect it.
    margin = 0.25 * np.linalg.norm(step, axis=1, keepdims=True)
    limit = np.array([grey.shape[1], grey.shape[0]]) - 1.0
    in_image = ((next_row > margin) & (next_row < limit - margin)).all(axis=1)
    if np.count_nonzero(in_image) < max(2.0, 0.5 * columns):
        return False
    row_step = np.gradient(next_row, axis=0)
    fitted, strength, _ = refine_corners(
        grey, next_row[in_image], row_step[in_image], step[in_image]
    )
    distance_px = np.linalg.norm(fitted - next_row[in_image], axis=1)
    confirmed = (-strength / amplitude[0][in_image] > MIN_CROSSING) & (
        distance_px < margin[in_image, 0]
    )
    return bool(2 * np.count_nonzero(confirmed) > len(confirmed))


def apply_homography(matrix: NDArray[Any], x: Float64Array, y: Float64Array) -> Float64Array:
    """Map points of a plane into the image.

    Parameters
    ----------
    matrix : (3, 3)
        The homography.
    x, y : (...)
        Coordinates on the plane.

    Returns
    -------
    (..., 2)
        (u, v).
    """
    mapped = np.stack([x, y, np.ones_like(x)], axis=-1) @ np.asarray(matrix, dtype=np.float64).T
    return np.asarray(mapped[..., :2] / mapped[..., 2:])


def grid_misfit_px(
    flat: Float64Array, corners: Float64Array, matrix: NDArray[Any], size: tuple[int, int]
) -> Float64Array:
    """Return the distances of corners from a perspective grid bent by two radial coefficients.

    Parameters
    ----------
    flat : (N, 2)
        The corners on the board.
    corners : (N, 2)
        (u, v) of the same corners in the image.
    matrix : (3, 3)
        Homography from board to image, the start value.
    size : (width, height)
        Size of the image.

    Returns
    -------
    (N,)
        Distances in pixels.
    """
    centre = 0.5 * (np.array(size) - 1.0)
    scale = 0.5 * max(size)

    from scipy.optimize import least_squares  # slow to import

    def misfit(values: Float64Array) -> Float64Array:
        h = np.append(values[:8], 1.0).reshape(3, 3)
        straight = (apply_homography(h, flat[:, 0], flat[:, 1]) - centre) / scale
        r2 = np.sum(straight**2, axis=1, keepdims=True)
        bent = straight * (1.0 + r2 * (values[8] + r2 * values[9]))
        return np.asarray((bent * scale + centre - corners).ravel())

    start = np.append(np.asarray(matrix, dtype=np.float64).ravel()[:8], [0.0, 0.0])
    fit = least_squares(misfit, start, method="lm", x_scale=np.maximum(np.abs(start), 1e-3))
    return np.asarray(np.linalg.norm(fit.fun.reshape(-1, 2), axis=1))


def foreshortening_tilt_deg(matrix: NDArray[Any], at: Float64Array) -> float:
    """Return the tilt from the foreshortening at a point: arccos(short side / long side).

    Parameters
    ----------
    matrix : (3, 3)
        Homography from board to image.
    at : (2,)
        The point on the board.
    """
    step = 1e-3
    x = at[0] + step * np.array([0.0, 1.0, 0.0])
    y = at[1] + step * np.array([0.0, 0.0, 1.0])
    origin, right, down = apply_homography(matrix, x, y)
    long, short = np.linalg.svd(np.stack([right - origin, down - origin]), compute_uv=False)
    return math.degrees(math.acos(min(1.0, short / long)))
