"""One place in all views: what is read there, and the pixel that sees it."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.inspect.place import PixelPlaces, read_at
from app.inspect.scale_bar import length_text, round_length_mm
from gelpolight_core.calibration.calibration import Calibration
from gelpolight_core.reconstruction.heightmap import Flag, HeightMap


def test_a_reading_holds_depth_slope_and_flags(dome: HeightMap) -> None:
    reading = read_at(dome, 3.5, -1.0)
    assert reading is not None
    assert reading.depth_mm == pytest.approx(0.8 - 0.25, abs=0.01)
    assert reading.slope_deg == pytest.approx(np.degrees(np.arctan(2 * 1.5 / 9.0)), abs=0.5)
    assert reading.flags == 0 and "no flags" in reading.text()


def test_flags_are_named_and_places_off_the_map_have_no_reading(dome: HeightMap) -> None:
    dark = read_at(dome, float(dome.x_mm[45]), float(dome.y_mm[85]))
    assert dark is not None
    assert dark.flags == Flag.DARK and "in shadow" in dark.text()
    assert read_at(dome, 20.0, 0.0) is None


def test_pixels_and_places_belong_to_each_other(small_calibration: Calibration) -> None:
    table = small_calibration.table
    places = PixelPlaces(table)
    depth = np.full(table.valid.shape, 0.5, np.float32)
    for x, y in ((0.0, 0.0), (5.0, -4.0), (-6.0, 3.0)):
        pixel = places.pixel_of(x, y, depth)
        assert pixel is not None
        back = places.place_of(*pixel, depth)
        assert back == pytest.approx((x, y), abs=1.5 * table.grid.pitch_mm)
    assert places.place_of(-40.0, -40.0) is None
    assert places.pixel_of(100.0, 0.0) is None


@given(st.floats(1e-4, 1e3))
def test_a_scale_bar_has_a_round_length_that_fits(largest: float) -> None:
    length = round_length_mm(largest)
    assert 0.39 * largest < length <= largest * (1.0 + 1e-6)
    assert float(f"{length:.0e}") == pytest.approx(length)


def test_short_lengths_are_written_in_micrometres() -> None:
    assert length_text(0.05) == "50 um"
    assert length_text(5.0) == "5 mm"
