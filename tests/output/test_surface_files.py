"""Surfaces for metrology, read by other people's readers."""

from dataclasses import replace

import gwyfile
import numpy as np
import pytest
import x3pio

from gelpolight_core.output.heightmap_files import write_heightmap
from gelpolight_core.reconstruction.height_map import Flag, HeightMap
from tests.measurement.maps import made


@pytest.fixture
def heightmap():
    """Return a ramp with one place outside the working area and one without depth."""
    ramp = made(lambda x, y: 0.1 * (x + 8.0) + 0.02 * y)
    depth_mm, flags = ramp.depth_mm.copy(), ramp.flags.copy()
    depth_mm[3, 4], flags[5, 6] = np.nan, Flag.OUTSIDE
    return replace(ramp, depth_mm=depth_mm, flags=flags)


def expected_m(heightmap: HeightMap) -> np.ndarray:
    out = np.uint8(Flag.OUTSIDE | Flag.INVALID)
    heights = -1e-3 * heightmap.depth_mm.astype(np.float64)
    return np.where(heightmap.flags & out, np.nan, heights)


@pytest.mark.function("Write X3P for surface metrology")
def test_x3p_is_the_surface_in_metres(tmp_path, heightmap):
    (path,) = write_heightmap(heightmap, tmp_path, formats="x3p")
    read = x3pio.read(path)
    points = read.layers[0].points()
    assert heightmap.calibration_id in read.metadata.comment
    heights_m = expected_m(heightmap)
    assert np.isnan(heights_m[3, 4]) and np.isnan(heights_m[5, 6])
    np.testing.assert_allclose(points[..., 2], heights_m, rtol=1e-6, atol=1e-12)
    known = np.isfinite(heights_m)
    x, y = np.meshgrid(1e-3 * heightmap.x_mm, 1e-3 * heightmap.y_mm)
    np.testing.assert_allclose(points[known][:, 0], x[known], atol=1e-9)
    np.testing.assert_allclose(points[known][:, 1], y[known], atol=1e-9)


@pytest.mark.function("Write Gwyddion's GWY")
def test_gwyddion_reads_the_surface_with_its_units(tmp_path, heightmap):
    (path,) = write_heightmap(heightmap, tmp_path, formats="gwy")
    container = gwyfile.load(str(path))
    (field,) = gwyfile.util.get_datafields(container).values()
    heights_m = expected_m(heightmap)
    known = np.isfinite(heights_m)
    np.testing.assert_allclose(field.data[known], heights_m[known], rtol=1e-6, atol=1e-12)
    np.testing.assert_array_equal(container["/0/mask"].data == 1.0, ~known)
    assert (field.si_unit_xy.unitstr, field.si_unit_z.unitstr) == ("m", "m")
    assert field.xreal == pytest.approx(1e-3 * heightmap.pitch_mm * known.shape[1])
    assert field.yreal == pytest.approx(1e-3 * heightmap.pitch_mm * known.shape[0])
    half_m = 0.5e-3 * heightmap.pitch_mm
    first_m = field.xoff + half_m, field.yoff + half_m
    assert first_m == pytest.approx((1e-3 * heightmap.x_mm[0], 1e-3 * heightmap.y_mm[0]))


def test_a_ball_pressed_in_beside_the_middle_is_the_same_pit_in_gwy_and_x3p(tmp_path):
    press = made(lambda x, y: np.maximum(0.5 - ((x - 2.0) ** 2 + (y + 1.0) ** 2) / 8.0, 0.0))
    gwy, x3p = write_heightmap(press, tmp_path, formats=("gwy", "x3p"))
    (field,) = gwyfile.util.get_datafields(gwyfile.load(str(gwy))).values()
    heights_m = x3pio.read(x3p).layers[0].points()[..., 2]
    known = np.isfinite(heights_m)
    np.testing.assert_allclose(field.data[known], heights_m[known], atol=1e-9)
    lowest_highest = heights_m[known].min(), heights_m[known].max()
    assert lowest_highest == pytest.approx((-0.5e-3, 0.0), rel=1e-2)
    row, column = np.unravel_index(np.nanargmin(heights_m), heights_m.shape)
    assert press.x_mm[column] == pytest.approx(2.0, abs=press.pitch_mm)
    assert press.y_mm[row] == pytest.approx(-1.0, abs=press.pitch_mm)
