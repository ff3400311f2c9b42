"""The fitted indenter as a solid in the 3D view."""

from dataclasses import replace

import numpy as np
import pytest

from app.measure.indenter_mesh import solid_of
from app.views.surface.display_surface import ColourScale, surface_of
from gelpolight_core.geometry.membrane_shape import MembraneShape
from gelpolight_core.measurement.indenter_models import MODELS
from gelpolight_core.measurement.object_measurement import measure_heightmap
from tests.measurement.maps import made
from tests.measurement.test_fit_residual import OBJECTS


@pytest.mark.function("See the fitted object as a body in 3D")
@pytest.mark.parametrize("shape", OBJECTS)
def test_the_solid_has_the_position_and_size_of_the_object(shape):
    heightmap = made(lambda x, y: MODELS[shape].depth(OBJECTS[shape], x, y))
    measured = measure_heightmap(heightmap, shape=shape)
    left, right, low, high, under, over = solid_of(measured).bounds
    # x as in the sensor's frame, y reversed, z depth.
    outline = measured.outline_mm
    if shape != "ball":  # a ball is wider above its contact
        assert (left, right) == pytest.approx((outline[:, 0].min(), outline[:, 0].max()), abs=0.03)
        assert (low, high) == pytest.approx((-outline[:, 1].max(), -outline[:, 1].min()), abs=0.03)
    assert 0.5 * (left + right) == pytest.approx(1.2, abs=0.05)
    assert 0.5 * (low + high) == pytest.approx(0.7, abs=0.05)
    assert under == pytest.approx(0.0, abs=0.03) and over == pytest.approx(0.8, abs=0.03)


def test_on_a_curved_membrane_the_solid_ends_at_the_surface_that_is_shown():
    curved = MembraneShape("spherical_cap", apex_height_mm=1.0, diameter_mm=30.0)
    model = MODELS["cylinder"].on(curved)
    flat = made(lambda x, y: model.depth(OBJECTS["cylinder"], x, y))
    heightmap = replace(flat, at_rest=curved)
    measured = measure_heightmap(heightmap, shape="cylinder")
    shown = surface_of(
        heightmap, np.zeros((2, 2, 3), np.uint8), ColourScale("", np.zeros((256, 3)), 0, 1),
        range_mm=(0.0, 1.0),
    )  # fmt: skip
    (plateau,) = shown.depth_at(*np.array(measured.centre_mm)[:, None])
    assert solid_of(measured, curved).bounds[5] == pytest.approx(plateau, abs=0.03)
    assert abs(solid_of(measured).bounds[5] - plateau) > 0.5


def test_a_turned_cuboid_turns_as_in_the_image():
    heightmap = made(lambda x, y: MODELS["cuboid"].depth(OBJECTS["cuboid"], x, y))
    measured = measure_heightmap(heightmap, shape="cuboid")
    body = solid_of(measured)
    corners = body.points[:, :2] * (1.0, -1.0)  # back to the sensor's frame
    for corner in measured.outline_mm[:4]:
        assert np.hypot(*(corners - corner).T).min() < 0.03
