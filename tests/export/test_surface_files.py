"""Surfaces for metrology and robots, read by other people's readers or by the published format."""

from dataclasses import replace

import gwyfile
import numpy as np
import pytest
import sdfio
import x3pio

from gelpolight_core.export.heightmap_files import write_heightmap
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


@pytest.mark.parametrize("name", ["x3p", "sdf"])
def test_programs_of_metrology_read_the_surface_in_metres(name, tmp_path, heightmap):
    (path,) = write_heightmap(heightmap, tmp_path, formats=name)
    if name == "x3p":
        read = x3pio.read(path)
        points, first = read.layers[0].points(), (heightmap.x_mm[0], heightmap.y_mm[0])
        assert heightmap.calibration_id in read.metadata.comment
    else:
        points, first = sdfio.read(path).points(), (0.0, 0.0)
    heights_m = expected_m(heightmap)
    assert np.isnan(heights_m[3, 4]) and np.isnan(heights_m[5, 6])
    np.testing.assert_allclose(points[..., 2], heights_m, rtol=1e-6, atol=1e-12)
    rows, columns = heights_m.shape
    x_mm = first[0] + heightmap.pitch_mm * np.arange(columns)
    y_mm = first[1] + heightmap.pitch_mm * np.arange(rows)
    known = np.isfinite(heights_m)
    x, y = np.meshgrid(1e-3 * x_mm, 1e-3 * y_mm)
    np.testing.assert_allclose(points[known][:, 0], x[known], atol=1e-9)
    np.testing.assert_allclose(points[known][:, 1], y[known], atol=1e-9)


def test_gwyddion_reads_the_depth_with_its_units(tmp_path, heightmap):
    (path,) = write_heightmap(heightmap, tmp_path, formats="gwy")
    container = gwyfile.load(str(path))
    (field,) = gwyfile.util.get_datafields(container).values()
    heights_m = expected_m(heightmap)
    known = np.isfinite(heights_m)
    np.testing.assert_allclose(field.data[known], -heights_m[known], rtol=1e-6, atol=1e-12)
    np.testing.assert_array_equal(container["/0/mask"].data == 1.0, ~known)
    assert (field.si_unit_xy.unitstr, field.si_unit_z.unitstr) == ("m", "m")
    assert field.xreal == pytest.approx(1e-3 * heightmap.pitch_mm * known.shape[1])
    first_m = field.xoff + 0.5 * field.xreal / known.shape[1]
    assert first_m == pytest.approx(1e-3 * heightmap.x_mm[0])


def test_pcd_follows_the_published_format(tmp_path, heightmap):
    (path,) = write_heightmap(heightmap, tmp_path, formats="pcd")
    head, _, data = path.read_bytes().partition(b"DATA binary\n")
    fields = dict(line.split(" ", 1) for line in head.decode("ascii").splitlines())
    assert list(fields) == [
        *("VERSION", "FIELDS", "SIZE", "TYPE", "COUNT", "WIDTH", "HEIGHT", "VIEWPOINT", "POINTS")
    ]
    assert (fields["FIELDS"], fields["SIZE"], fields["TYPE"]) == ("x y z", "4 4 4", "F F F")
    rows, columns = int(fields["HEIGHT"]), int(fields["WIDTH"])
    assert (rows, columns) == heightmap.depth_mm.shape
    assert int(fields["POINTS"]) == rows * columns
    points = np.frombuffer(data, "<f4").reshape(rows, columns, 3)
    np.testing.assert_allclose(points[2, :, 0], 1e-3 * heightmap.x_mm, rtol=1e-6)
    np.testing.assert_allclose(points[:, 2, 1], 1e-3 * heightmap.y_mm, rtol=1e-6)
    np.testing.assert_allclose(points[..., 2], expected_m(heightmap), rtol=1e-6)
