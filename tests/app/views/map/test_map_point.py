"""One point in all views: its values, and the pixel that sees it."""

import numpy as np
import pytest

from app.views.map.map_point import read_at
from gelpolight_core.reconstruction.height_map import Flag


def test_a_reading_holds_depth_slope_and_flags(dome):
    reading = read_at(dome, 3.5, -1.0)
    assert reading.depth_mm == pytest.approx(0.8 - 0.25, abs=0.01)
    assert reading.slope_deg == pytest.approx(np.degrees(np.arctan(2 * 1.5 / 9.0)), abs=0.5)
    assert reading.flags == 0 and "\n" not in reading.detail()


def test_flags_are_named_and_points_off_the_map_have_no_reading(dome):
    dark = read_at(dome, float(dome.x_mm[45]), float(dome.y_mm[85]))
    assert dark.flags == Flag.DARK and "in shadow" in dark.detail()
    assert read_at(dome, 20.0, 0.0) is None
