"""Shadow under point and directional light (Fig. 1)."""

from __future__ import annotations

import math

import pytest

from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.simulation.directional import (
    directional_lamps,
    shadow_areas,
    shadow_comparison,
)
from gelpolight_core.simulation.indenters import Cylinder, press

DEPTHS_MM = (0.0, 0.5, 1.0, 1.5)


@pytest.fixture(scope="module")
def comparison():
    """Return a small table."""
    return shadow_comparison(SensorDesign().leds, decay_mm=0.7, depths_mm=DEPTHS_MM, pitch_mm=0.08)


def test_shadow_grows_with_depth(comparison) -> None:
    for lighting in ("point", "directional"):
        setting = next(row.setting for row in comparison.rows if row.lighting == lighting)
        depth, area = comparison.curve(lighting, setting)
        assert tuple(depth) == DEPTHS_MM
        assert (area[1:] >= area[:-1]).all() and area[-1] > area[-2] > 0.0


def test_steeper_light_throws_less_shadow(comparison) -> None:
    low, middle, high = (comparison.curve("directional", e)[1][-1] for e in (15.0, 30.0, 45.0))
    assert high < middle < low


def test_low_light_shadow_has_the_size_that_the_outline_gives() -> None:
    # The shadow of a cylinder is its outline moved away from the light: diameter x length.
    depth, elevation = 1.0, 10.0
    surface = press(Cylinder(4.0, depth), pitch_mm=0.05, decay_mm=0.05, margin_mm=7.0)
    mean, _, _ = shadow_areas(surface, directional_lamps(elevation)[:1])
    length = depth / math.tan(math.radians(elevation))
    assert mean == pytest.approx(4.0 * length, rel=0.05)
