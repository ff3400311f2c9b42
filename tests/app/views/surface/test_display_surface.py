"""The nodes that the 3D view draws."""

from dataclasses import replace

import numpy as np
import pytest

from app.views.surface.display_surface import ColourScale, surface_of
from gelpolight_core.geometry.membrane_shape import MembraneShape
from tests.app.views.surface.conftest import BUMP, SMALL


def test_the_mesh_ends_at_the_rim_of_the_working_area(made):
    surface = made()
    rim = np.hypot(surface.x_mm[:, [0, -1]], surface.y_mm[:, None])
    assert np.abs(rim[5:-5] - 8.0).max() < 0.15


@pytest.mark.parametrize("largest", [60, 128, None])
def test_the_depth_at_a_point_equals_that_of_the_map(made, largest):
    surface = made(largest=largest)
    places = np.array([BUMP[:2], SMALL[:2], (0.0, 0.0), (30.0, 0.0)])
    found = surface.depth_at(places[:, 0], places[:, 1])
    assert found == pytest.approx([BUMP[2], SMALL[2], 0.0, -np.inf], abs=0.02)


def test_an_empty_working_area_has_no_surface(heightmap):
    heightmap.flags[:] = 1
    scale = ColourScale("depth (mm)", np.zeros((256, 3), np.uint8), 0.0, 1.0)
    texture = np.zeros((8, 8, 3), np.uint8)
    assert surface_of(heightmap, texture, scale, range_mm=(0.0, 1.0)) is None


def test_a_curved_membrane_is_shown_itself(heightmap):
    cap = MembraneShape("spherical_cap", 2.0, 18.0, (0.5, -0.25))
    scale = ColourScale("depth (mm)", np.zeros((256, 3), np.uint8), 0.0, 1.0)
    texture = np.zeros((8, 8, 3), np.uint8)
    found = surface_of(replace(heightmap, at_rest=cap), texture, scale, range_mm=(0.0, 1.0))
    assert found is not None
    places = np.array([BUMP[:2], SMALL[:2], (0.0, 5.0)])
    expected = np.array([BUMP[2], SMALL[2], 0.0]) - cap.height(places)
    assert found.depth_at(places[:, 0], places[:, 1]) == pytest.approx(expected, abs=0.02)
    assert found.range_mm[0] == pytest.approx(-2.0, abs=0.01)
    assert found.range_mm[0] <= found.depth_mm.min()
    assert found.curved and found.axis == (-1.0, "height (mm)")
