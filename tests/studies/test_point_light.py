"""Point and directional light: each method is right under its own light."""

from __future__ import annotations

import math

import pytest

from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.simulation.indenters import Cylinder, press
from tests.studies.point_light import parallel_light, rows, shadow_areas


def test_each_method_is_right_under_its_own_light() -> None:
    point, directional = rows(SensorDesign(), height_shares=(1.0,), elevations_deg=(45.0,))
    assert point.near_um is not None and point.directional_um is not None
    assert directional.near_um is not None and directional.directional_um is not None
    assert point.near_um < 12.0 < 5.0 * point.near_um < point.directional_um
    assert directional.directional_um < 15.0 < 3.0 * directional.directional_um
    assert 3.0 * directional.directional_um < directional.near_um


def test_low_light_shadow_has_the_size_that_the_outline_gives() -> None:
    # The shadow of a cylinder is its outline moved away from the light: diameter x length.
    depth, elevation = 1.0, 10.0
    surface = press(Cylinder(4.0, depth), pitch_mm=0.05, decay_mm=0.05, margin_mm=7.0)
    mean, _, _ = shadow_areas(surface, (parallel_light(90.0, elevation),))
    assert mean == pytest.approx(4.0 * depth / math.tan(math.radians(elevation)), rel=0.05)
