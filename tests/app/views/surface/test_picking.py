"""From rays to points, and the measurements between two points."""

import math
import re

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.views.surface.display_surface import intersect_ray, pins_text, with_pin
from tests.app.views.surface.conftest import BUMP, SMALL


def test_nearer_parts_hide_parts_behind_them(made):
    surface = made()
    # A low ray along +x at the bump's y, at half height: it hits the bump's near side.
    found = intersect_ray(surface, np.array([-20.0, BUMP[1], 0.5]), np.array([20.0, BUMP[1], 0.5]))
    assert found == pytest.approx((BUMP[0] - 1.5, BUMP[1]), abs=0.05)


@settings(max_examples=60)
@given(st.floats(-5.0, 5.0), st.floats(-5.0, 5.0), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
def test_any_ray_from_above_ends_on_the_surface(x, y, lean_x, lean_y):
    surface = _ramp()
    start, end = np.array([x + lean_x, y + lean_y, 3.0]), np.array([x - lean_x, y - lean_y, -3.0])
    found = intersect_ray(surface, start, end)
    assert found is not None
    # The ramp's depth is 0.1 x: solved for the ray by hand.
    share = (start[2] - 0.1 * start[0]) / (start[2] - end[2] - 0.1 * (start[0] - end[0]))
    assert found == pytest.approx(tuple((start + share * (end - start))[:2]), abs=0.01)


def _ramp():  # type: ignore[no-untyped-def]
    from app.views.surface.display_surface import ColourScale, DisplaySurface

    x, y = np.meshgrid(np.linspace(-9, 9, 91), np.linspace(-9, 9, 91))
    table = np.zeros((256, 3), np.uint8)
    return DisplaySurface(
        x.astype(np.float32), y[:, 0].astype(np.float32), (0.1 * x).astype(np.float32),
        (-9.0, -9.0, 9.0, 9.0), np.zeros((4, 4, 3), np.uint8), ColourScale("", table, 0.0, 1.0),
        (-0.9, 0.9), curved=False,
    )  # fmt: skip


@pytest.mark.function("Pin two points: distance, height and angle")
def test_two_points_give_distance_height_and_angle(made):
    surface = made()
    text = pins_text(surface, (SMALL[:2], BUMP[:2]))
    across = math.dist(SMALL[:2], BUMP[:2])
    found = [float(x) for x in re.findall(r"(?:distance|across|difference|angle) ([-+\d.]+)", text)]
    angle = math.degrees(math.atan2(0.6, across))
    assert found == pytest.approx([math.hypot(across, 0.6), across, 0.6, angle], abs=0.1)
    assert "distance" not in pins_text(surface, ((0.0, 0.0), (30.0, 0.0)))


def test_a_third_pin_replaces_the_first(made):
    pins = with_pin(with_pin(with_pin((), (0.0, 0.0)), (1.0, 0.0)), (2.0, 0.0))
    assert pins == ((1.0, 0.0), (2.0, 0.0))
    one = pins_text(made(), ((-6.0, 0.0),))
    two = pins_text(made(), ((-6.0, 0.0), (-5.0, 0.0)))
    assert one.count("\n") == 0 and two.startswith(one)
    assert "1.000 mm" in two and "+0.0 µm" in two
