"""Shadow under point and directional light (Fig. 1)."""

from __future__ import annotations

import math

import pytest

from gelpolight_core.simulation.directional import (
    directional_lamps,
    shadow_areas,
    shadow_comparison,
)
from gelpolight_core.simulation.indenters import Cylinder, press


@pytest.fixture(scope="module")
def comparison():
    """Return a small table."""
    return shadow_comparison(
        led_heights_mm=(8.0, 20.0),
        elevations_deg=(15.0, 45.0),
        depths_mm=(0.0, 0.5, 1.0, 1.5),
        pitch_mm=0.08,
    )


@pytest.mark.parametrize("lighting, setting", [("point", 8.0), ("directional", 15.0)])
def test_shadow_grows_with_depth(comparison, lighting: str, setting: float) -> None:
    depth, area = comparison.curve(lighting, setting)
    assert list(depth) == [0.0, 0.5, 1.0, 1.5]
    assert (area[1:] > area[:-1]).all()


def test_steeper_light_throws_less_shadow(comparison) -> None:
    for lighting, low, high in (("point", 8.0, 20.0), ("directional", 15.0, 45.0)):
        assert comparison.curve(lighting, high)[1][-1] < comparison.curve(lighting, low)[1][-1]


def test_low_light_shadow_has_the_size_that_the_outline_gives() -> None:
    # The shadow of a cylinder is its outline moved away from the light: diameter x length.
    depth, elevation = 1.0, 10.0
    surface = press(Cylinder(4.0, depth), pitch_mm=0.05, decay_mm=0.05, margin_mm=7.0)
    mean, _, _ = shadow_areas(surface, directional_lamps(elevation)[:1])
    length = depth / math.tan(math.radians(elevation))
    assert mean == pytest.approx(4.0 * length, rel=0.05)
