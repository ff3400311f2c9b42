"""A frozen height map keeps its steep walls."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gelpolight_core.errors import InputError
from gelpolight_core.experiments.integrators.surfaces import Surface, surface
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.reconstruction.integration.poisson import integrate_slopes
from gelpolight_core.reconstruction.steep_walls import keep_steep_walls


def height_map_of(made: Surface) -> HeightMap:
    """Return what a reconstruction makes of exact slopes."""
    normals = np.stack([-made.slope_x, -made.slope_y, -np.ones_like(made.slope_x)], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    depth = integrate_slopes(made.slope_x, made.slope_y, pitch_mm=made.pitch_mm).depth_mm
    axis = made.pitch_mm * np.arange(len(depth))
    flags = np.zeros(depth.shape, np.uint8)
    return HeightMap(
        depth.astype(np.float32), axis, axis, made.pitch_mm, normals.astype(np.float32), flags,
        "id", "full", "press.png",
    )  # fmt: skip


def median_um(depth_mm: np.ndarray, made: Surface) -> float:
    return 1e3 * float(np.median(np.abs(depth_mm - made.depth_mm)))


def test_beside_a_steep_wall_the_error_is_less_than_half() -> None:
    made = surface("wedge", 120)
    before = height_map_of(made)
    after = keep_steep_walls(before)
    assert median_um(after.depth_mm, made) < 0.5 * median_um(before.depth_mm, made)
    assert "bilateral" in after.notes[-1]


def test_a_smooth_press_stays_as_it_is() -> None:
    made = surface("bump", 120)
    after = keep_steep_walls(height_map_of(made))
    assert np.abs(after.depth_mm - made.depth_mm).max() < 0.015


def test_without_contact_nothing_changes_and_without_normals_it_is_refused() -> None:
    made = surface("bump", 40)
    empty = replace(height_map_of(made), depth_mm=np.zeros((40, 40), np.float32))
    assert keep_steep_walls(empty) is empty
    with pytest.raises(InputError, match="no normals"):
        keep_steep_walls(replace(empty, normals=None))
