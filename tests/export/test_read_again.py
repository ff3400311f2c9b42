"""Exported files are read again: meshes by pyvista, height maps by this program."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from gelpolight_core.errors import InputError
from gelpolight_core.export.heightmap_files import MESH_FORMATS, write_heightmap
from gelpolight_core.export.raster import read_npz
from gelpolight_core.reconstruction.height_map import HeightMap
from tests.measurement.maps import made


def _ramp() -> HeightMap:
    return made(lambda x, y: 0.1 * (x + 8.0) + 0.0 * y)


@pytest.mark.parametrize("name", MESH_FORMATS)
def test_a_mesh_has_its_size_in_mm(name: str, tmp_path: Path) -> None:
    pv = pytest.importorskip("pyvista")
    heightmap = _ramp()
    (path,) = write_heightmap(heightmap, tmp_path, formats=(name,))
    mesh = pv.read(path)
    # glTF uses metres.
    bounds = np.array(mesh.bounds) * (1e3 if name == "glb" else 1.0)
    inside = heightmap.flags == 0
    rows = np.flatnonzero(inside.any(axis=1))
    y = heightmap.y_mm[rows[[0, -1]]]
    x, deepest = heightmap.x_mm[[0, -1]], float(heightmap.depth_mm.max())
    assert bounds == pytest.approx((*x, *y, -deepest, 0.0), abs=1e-3)


def test_a_height_map_is_read_as_it_was_written(tmp_path: Path) -> None:
    heightmap = _ramp()
    (path,) = write_heightmap(heightmap, tmp_path, formats=("npz",))
    again = read_npz(path)
    for name in ("depth_mm", "x_mm", "y_mm", "flags"):
        np.testing.assert_array_equal(getattr(again, name), getattr(heightmap, name))
    assert (again.pitch_mm, again.calibration_id) == (heightmap.pitch_mm, "T-1")


@pytest.mark.parametrize("content", [b"", b"PK\x03\x04 not a zip", b"\x93NUMPY"])
def test_another_file_is_refused(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "other.npz"
    path.write_bytes(content)
    with pytest.raises(InputError):
        read_npz(path)
    with pytest.raises(InputError):
        read_npz(tmp_path / "none.npz")
