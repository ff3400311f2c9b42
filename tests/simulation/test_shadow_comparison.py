"""Shadow under point and directional light (Fig. 1)."""

from __future__ import annotations

import math
from pathlib import Path

import cv2
import pytest

from gelpolight_core.simulation.directional import (
    directional_lamps,
    draw_shadow_comparison,
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


def test_no_depth_throws_no_shadow(comparison) -> None:
    assert all(r.any_shadow_mm2 == 0.0 for r in comparison.rows if r.depth_mm == 0.0)


@pytest.mark.parametrize("lighting, setting", [("point", 8.0), ("directional", 15.0)])
def test_shadow_grows_with_depth(comparison, lighting: str, setting: float) -> None:
    depth, area = comparison.curve(lighting, setting)
    assert list(depth) == [0.0, 0.5, 1.0, 1.5]
    assert (area[1:] > area[:-1]).all()


def test_steeper_light_throws_less_shadow(comparison) -> None:
    for lighting, low, high in (("point", 8.0, 20.0), ("directional", 15.0, 45.0)):
        assert comparison.curve(lighting, high)[1][-1] < comparison.curve(lighting, low)[1][-1]


def test_areas_are_consistent(comparison) -> None:
    for row in comparison.rows:
        assert row.two_dark_mm2 <= row.any_shadow_mm2 <= 3.0 * row.mean_shadow_mm2 + 1e-9


def test_low_light_shadow_has_the_size_that_the_outline_gives() -> None:
    # The shadow of a cylinder is its outline moved away from the light: diameter x length.
    depth, elevation = 1.0, 10.0
    surface = press(Cylinder(4.0, depth), pitch_mm=0.05, decay_mm=0.05, margin_mm=7.0)
    mean, _, _ = shadow_areas(surface, directional_lamps(elevation)[:1])
    length = depth / math.tan(math.radians(elevation))
    assert mean == pytest.approx(4.0 * length, rel=0.05)


def test_the_figure_is_an_image(comparison, tmp_path: Path) -> None:
    draw_shadow_comparison(comparison, tmp_path / "shadow.png")
    image = cv2.imread(str(tmp_path / "shadow.png"))
    assert image.shape[0] > 400
    assert image.std() > 5.0
