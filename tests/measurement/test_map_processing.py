"""Levelling and comparing of height maps."""

from dataclasses import replace

import numpy as np
import pytest
from maps import made

from gelpolight_core.base.errors import InputError
from gelpolight_core.geometry.membrane_shape import MembraneShape
from gelpolight_core.measurement.map_processing import (
    depth_below_boundary_plane,
    level_by_plane,
    level_by_points,
    subtract_map,
)
from gelpolight_core.reconstruction.height_map import Flag, HeightMap


def tilted_press() -> HeightMap:
    """Return a round press of 0.5 mm on a tilted surface."""
    return made(lambda x, y: 0.02 * x - 0.01 * y + 0.1 + 0.5 * (np.hypot(x, y) < 1.0))


def test_levelling_leaves_out_the_pressed_object():
    level = level_by_plane(tilted_press())
    middle = level.depth_mm[level.depth_mm.shape[0] // 2, level.depth_mm.shape[1] // 2]
    assert middle == pytest.approx(0.5, abs=2e-4)
    assert np.median(level.depth_mm) == pytest.approx(0.0, abs=2e-4)
    assert "plane" in level.findings[-1].text
    assert level.normals is None


def test_a_plane_can_be_fitted_to_a_chosen_area():
    press = tilted_press()
    mask = np.zeros(press.depth_mm.shape, bool)
    mask[:, :20] = True
    assert np.abs(level_by_plane(press, mask=mask).depth_mm[mask]).max() < 1e-5
    with pytest.raises(InputError, match="fewer than three"):
        level_by_plane(press, mask=np.zeros_like(mask))


def test_three_points_read_zero_afterwards():
    level = level_by_points(tilted_press(), ((-2.0, -2.0), (2.0, -2.0), (0.0, 2.0)))
    middle = level.depth_mm[level.depth_mm.shape[0] // 2, level.depth_mm.shape[1] // 2]
    assert middle == pytest.approx(0.5, abs=1e-4)
    for points in (((0, 0), (1, 1), (2, 2)), ((0, 0), (1, 1), (500, 0))):
        with pytest.raises(InputError, match="line"):
            level_by_points(tilted_press(), points)


def test_a_difference_is_valid_where_both_maps_are():
    press = tilted_press()
    bare = made(lambda x, y: 0.02 * x - 0.01 * y + 0.1)
    flags = bare.flags.copy()
    flags[0, 0] = int(Flag.OUTSIDE)
    left = subtract_map(press, replace(bare, flags=flags))
    assert float(left.depth_mm.max()) == pytest.approx(0.5, abs=1e-6)
    assert not left.known[0, 0]
    with pytest.raises(InputError, match="overlap"):
        subtract_map(press, replace(bare, x_mm=bare.x_mm + 100.0))


def test_a_difference_has_the_errors_of_both_maps_and_three_points_leave_none():
    press = tilted_press()
    sd = np.full(press.depth_mm.shape, 0.003, np.float32)
    one, other = replace(press, depth_sd_mm=sd), replace(press, depth_sd_mm=sd * 4.0 / 3.0)
    left = subtract_map(one, other)
    assert left.depth_sd_mm is not None
    np.testing.assert_allclose(left.depth_sd_mm, 0.005, rtol=1e-5)
    assert subtract_map(one, press).depth_sd_mm is None
    assert level_by_points(one, ((-2.0, -2.0), (2.0, -2.0), (0.0, 2.0))).depth_sd_mm is None


@pytest.mark.function("Show and measure a curved surface itself, in place of its indentation")
def test_a_flat_face_in_a_curved_membrane_is_a_plane_of_the_surface_itself():
    cap = MembraneShape("spherical_cap", 2.0, 26.0, (0.3, -0.4))
    face_mm = 1.2

    def depth(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.maximum(cap.height(np.stack([x, y], axis=-1)) - face_mm, 0.0)

    pressed = made(depth, at_rest=cap)
    x, y = np.meshgrid(pressed.x_mm, pressed.y_mm)
    face = np.hypot(x - 0.3, y + 0.4) < 4.0
    assert np.ptp(pressed.depth_mm[face]) > 0.1
    surface = depth_below_boundary_plane(pressed)
    np.testing.assert_allclose(surface.depth_mm[face], -face_mm, atol=1e-6)
    assert surface.at_rest.flat
    assert surface.findings[-1].key == "processed"
    flat = tilted_press()
    assert depth_below_boundary_plane(flat) is flat
