"""The resampling table: an asymmetric mark must be at its true position in millimetres."""

import numpy as np
import pytest

from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.geometry.camera import CameraModel
from gelpolight_core.geometry.refraction import build_stack, camera_to_membrane
from gelpolight_core.geometry.resampling import build_resampling_table
from gelpolight_core.geometry.sensor_frame import TopPlane

CAMERA = CameraModel(640, 480, 690.0, 692.0, 331.0, 236.0, (-0.08, 0.03, 0.001, -0.0005, 0.0))
NORMAL = np.array([0.012, -0.02, 1.0]) / np.linalg.norm([0.012, -0.02, 1.0])
PLANE = TopPlane((float(NORMAL[0]), float(NORMAL[1]), float(NORMAL[2])), 39.0)
STACK = build_stack(
    39.0, elastomer_thickness_mm=14.0, elastomer_index=1.41, window_thickness_mm=2.0
)


def test_every_raw_pixel_is_found_at_its_membrane_position():
    """Images of u and of v, resampled, give the pixel of each node, and its ray gives the node."""
    table = build_resampling_table(CAMERA, PLANE, STACK, working_diameter_mm=26.0)
    v, u = np.mgrid[: CAMERA.height, : CAMERA.width].astype(np.float32)
    found = table.apply(np.stack([u, v, u], axis=-1))
    rows, columns = np.nonzero(table.valid)
    pixels = found[rows, columns, :2].astype(np.float64)
    place, _ = camera_to_membrane(CAMERA.directions(pixels), PLANE, STACK)
    expected = np.stack([table.grid.x_mm[columns], table.grid.y_mm[rows]], axis=-1)
    # cv2.remap rounds to 1/32 pixel: 0.05 mm of footprint times 1/64.
    np.testing.assert_allclose(place, expected, atol=2e-3)


def test_the_grid_covers_what_is_seen_of_the_working_circle_and_no_more():
    table = build_resampling_table(CAMERA, PLANE, STACK, working_diameter_mm=16.0)
    x, y = table.grid.x_mm, table.grid.y_mm
    assert x[0] == pytest.approx(-8.0, abs=1.0)
    assert y[-1] == pytest.approx(8.0, abs=1.0)
    area = table.valid.sum() * table.grid.pitch_mm**2
    assert area == pytest.approx(np.pi * 64.0, rel=0.01)


def test_a_tilted_sensor_has_its_origin_below_the_camera():
    foot = PLANE.origin_camera_mm
    np.testing.assert_allclose(PLANE.to_sensor(foot), 0.0, atol=1e-12)
    np.testing.assert_allclose(PLANE.to_sensor(np.zeros(3)), [0.0, 0.0, -39.0], atol=1e-12)
    np.testing.assert_allclose(PLANE.to_camera(PLANE.to_sensor(np.ones(3))), 1.0, atol=1e-12)
    assert PLANE.rotation[0] @ np.array([1.0, 0.0, 0.0]) > 0.99
    assert np.linalg.det(PLANE.rotation) == pytest.approx(1.0)


def test_a_working_circle_of_a_few_pixels_is_refused_where_it_is_stated():
    with pytest.raises(InputError, match="working circle") as refusal:
        build_resampling_table(CAMERA, PLANE, STACK, working_diameter_mm=1.0)
    assert "sensor" in refusal.value.where
    assert refusal.value.advice == Remedy.CHECK_LENGTHS


def test_a_grid_that_would_not_fit_in_memory_is_refused():
    with pytest.raises(InputError, match="nodes"):
        build_resampling_table(CAMERA, PLANE, STACK, working_diameter_mm=26.0, pitch_mm=1e-5)
