"""One point in all views: its values, and the pixel that sees it."""

from __future__ import annotations

import numpy as np
import pytest

from app.view2d.map_point import PixelMap, read_at
from gelpolight_core.reconstruction.height_map import Flag, HeightMap
from gelpolight_core.sensor_calibration import Calibration


def test_a_reading_holds_depth_slope_and_flags(dome: HeightMap) -> None:
    reading = read_at(dome, 3.5, -1.0)
    assert reading is not None
    assert reading.depth_mm == pytest.approx(0.8 - 0.25, abs=0.01)
    assert reading.slope_deg == pytest.approx(np.degrees(np.arctan(2 * 1.5 / 9.0)), abs=0.5)
    assert reading.flags == 0 and "no flags" in reading.text()


def test_flags_are_named_and_points_off_the_map_have_no_reading(dome: HeightMap) -> None:
    dark = read_at(dome, float(dome.x_mm[45]), float(dome.y_mm[85]))
    assert dark is not None
    assert dark.flags == Flag.DARK and "in shadow" in dark.text()
    assert read_at(dome, 20.0, 0.0) is None


def test_pixels_and_points_convert_both_ways(small_calibration: Calibration) -> None:
    table = small_calibration.table
    places = PixelMap(table)
    depth = np.full(table.valid.shape, 0.5, np.float32)
    for x, y in ((0.0, 0.0), (5.0, -4.0), (-6.0, 3.0)):
        pixel = places.pixel_of(x, y, depth)
        assert pixel is not None
        back = places.point_of(*pixel, depth)
        assert back == pytest.approx((x, y), abs=1.5 * table.grid.pitch_mm)
    assert places.point_of(-40.0, -40.0) is None
    assert places.pixel_of(100.0, 0.0) is None
