"""Depth seen along oblique rays is moved to its true place."""

import cv2
import numpy as np
import pytest
from compiled import place_on_grid
from numpy.typing import NDArray

Array = NDArray[np.float64]
PITCH = 0.05
X = -6.0 + PITCH * np.arange(260)
Y = -4.0 + PITCH * np.arange(180)
POINTS = np.stack(np.meshgrid(X, Y), axis=-1)


def lopsided_depth(x: Array, y: Array) -> Array:
    """Return a bump that no swap or flip leaves alone, 1 mm deep at (2.0, -1.0)."""
    u, v = x - 2.0, y + 1.0
    return np.asarray(np.exp(-(u**2) / 2.0 - v**2 / 0.8) * (1.0 + 0.2 * u))


def leaning(points: Array) -> Array:
    """Return the slopes of the rays: towards the camera's foot, not the same along x and y."""
    x, y = points[..., 0], points[..., 1]
    return np.stack([-(x - 0.4) / 28.0, -(y + 0.7) / 33.0], axis=-1)


def seen_along_rays(depth_of: object, ray_slope: Array) -> Array:
    """Return the depth that each node's ray sees: d = depth(P0 + d w), by bisection."""
    low, high = np.zeros(POINTS.shape[:2]), np.full(POINTS.shape[:2], 3.0)
    for _ in range(60):
        middle = 0.5 * (low + high)
        place = POINTS + middle[..., None] * ray_slope
        above = middle > depth_of(place[..., 0], place[..., 1])
        low, high = np.where(above, low, middle), np.where(above, middle, high)
    return 0.5 * (low + high)


def resample(values: NDArray[np.float32], column: Array, row: Array) -> NDArray[np.float32]:
    """Return values at fractional nodes."""
    return np.asarray(cv2.remap(values, column, row, cv2.INTER_LINEAR))


def index_of(points: Array) -> tuple[Array, Array]:
    return (points[..., 0] - X[0]) / PITCH, (points[..., 1] - Y[0]) / PITCH


def inner(margin: int = 10) -> tuple[slice, slice]:
    return slice(margin, -margin), slice(margin, -margin)


def test_a_bump_is_at_its_true_place():
    ray_slope = leaning(POINTS)
    seen = seen_along_rays(lopsided_depth, ray_slope).astype(np.float32)
    truth = lopsided_depth(POINTS[..., 0], POINTS[..., 1])
    assert np.abs(seen - truth).max() > 0.03  # left where it is seen it would be wrong
    column, row, folded = place_on_grid(seen, ray_slope.astype(np.float32), X, Y)
    placed = resample(seen, column, row)
    # Linear interpolation: pitch^2 / 8 times the curvature, 3 per mm, is 1 um.
    assert np.abs(placed - truth)[inner()].max() < 1.5e-3
    assert not folded[inner()].any()


def test_every_place_knows_the_ray_that_sees_it():
    ray_slope = leaning(POINTS)
    seen = seen_along_rays(lopsided_depth, ray_slope)
    column, row, _ = place_on_grid(seen.astype(np.float32), ray_slope.astype(np.float32), X, Y)
    # Through the surface at a true position runs the ray from P0 = P - depth w(P0).
    truth = lopsided_depth(POINTS[..., 0], POINTS[..., 1])
    foot = POINTS.copy()
    for _ in range(60):
        foot = POINTS - truth[..., None] * leaning(foot)
    expected_column, expected_row = index_of(foot)
    assert np.abs(column - expected_column)[inner()].max() < 0.02
    assert np.abs(row - expected_row)[inner()].max() < 0.02


def test_upright_rays_and_a_flat_membrane_change_nothing():
    depth = lopsided_depth(POINTS[..., 0], POINTS[..., 1]).astype(np.float32)
    column, row, folded = place_on_grid(depth, np.zeros((*depth.shape, 2), np.float32), X, Y)
    np.testing.assert_array_equal(resample(depth, column, row), depth)
    assert not folded.any()
    flat = np.zeros_like(depth)
    column, row, folded = place_on_grid(flat, leaning(POINTS).astype(np.float32), X, Y)
    np.testing.assert_array_equal(resample(depth, column, row), depth)
    assert not folded.any()


@pytest.mark.parametrize("axis", [0, 1])
def test_the_floor_hidden_behind_a_wall_is_flagged(axis):
    """Rays lean by 0.3 per mm, so a wall 1 mm high hides a strip of 0.3 mm behind it."""
    lean = 0.3
    along = POINTS[..., axis]
    ray_slope = np.zeros_like(POINTS)
    ray_slope[..., axis] = lean
    # The ray of node s sees s + lean d. What stands 1 mm deep over 0..2 is seen by the nodes from
    # -0.3 to 1.7; those from 1.7 to 2 see the wall at 2. The ground from -0.3 to 0 is hidden.
    wall = np.clip((2.0 - along) / lean, 0.0, 1.0)
    seen = np.where(along > -lean, wall, 0.0).astype(np.float32)
    column, row, folded = place_on_grid(seen, ray_slope.astype(np.float32), X, Y)
    placed = resample(seen, column, row)
    middle = np.zeros_like(folded)
    middle[inner(20)] = True
    plateau = middle & (along > 0.1) & (along < 1.9)
    np.testing.assert_allclose(placed[plateau], 1.0, atol=1e-3)
    assert not folded[plateau].any()
    hidden = middle & (along > -lean + 0.1) & (along < -0.1)
    assert folded[hidden].mean() > 0.9
    ground = middle & ((along < -lean - 0.15) | (along > 2.0 + 0.15))
    np.testing.assert_allclose(placed[ground], 0.0, atol=1e-3)
    assert not folded[ground].any()
