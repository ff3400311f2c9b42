"""Exported files are read again: meshes by pyvista, height maps by this program."""

import struct
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from gelpolight_core.base.errors import InputError
from gelpolight_core.output.formats import FORMATS
from gelpolight_core.output.heightmap_files import write_heightmap
from gelpolight_core.output.mesh_files import Mesh
from gelpolight_core.output.raster import HEAD, read_npz
from gelpolight_core.reconstruction.height_map import HeightMap, normals_from_slopes, surface_slopes
from tests.measurement.maps import made


def _ramp() -> HeightMap:
    return made(lambda x, y: 0.1 * (x + 8.0) + 0.0 * y)


@pytest.mark.function("Write meshes in mm: PLY, STL, glTF")
@pytest.mark.parametrize("name", [f.key for f in FORMATS if f.of is Mesh])
def test_a_mesh_has_its_size_in_mm(name, tmp_path):
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


@pytest.mark.function("Read a written height map again")
def test_a_height_map_is_read_as_it_was_written(tmp_path):
    heightmap = _ramp()
    (path,) = write_heightmap(heightmap, tmp_path, formats=("npz",))
    again = read_npz(path)
    for name in ("depth_mm", "x_mm", "y_mm", "flags"):
        np.testing.assert_array_equal(getattr(again, name), getattr(heightmap, name))
    assert (again.pitch_mm, again.calibration_id) == (heightmap.pitch_mm, "T-1")
    assert (read_npz(_written(heightmap, tmp_path)).depth_mm == heightmap.depth_mm).all()


def _written(heightmap: HeightMap, folder: Path, **changed: np.ndarray) -> Path:
    """Write the map, with some of its arrays replaced, in NumPy's own way."""
    (path,) = write_heightmap(heightmap, folder, formats=("npz",))
    with np.load(path, allow_pickle=False) as stored:
        arrays = {name: stored[name] for name in stored if not changed or name not in HEAD}
    np.savez_compressed(path, **(arrays | changed))
    return path


@pytest.mark.function(
    "Refuse a height map that was changed after it was written, or is of a newer program"
)
@pytest.mark.parametrize("name", ["version", "format", "depth_mm"])
def test_a_changed_file_and_a_newer_one_are_refused(name, tmp_path):
    with np.load(_written(_ramp(), tmp_path)) as stored:
        arrays = dict(stored)
    np.savez(tmp_path / "changed.npz", **(arrays | {name: arrays[name] + arrays[name]}))
    with pytest.raises(InputError, match=r"version 2|marked|checksum"):
        read_npz(tmp_path / "changed.npz")


def test_numbers_that_contradict_each_other_are_refused(tmp_path):
    heightmap = _ramp()
    slope_x, slope_y = surface_slopes(heightmap.depth_mm, heightmap.pitch_mm)
    normals = normals_from_slopes(slope_x, slope_y)
    assert read_npz(_written(heightmap, tmp_path, normals=normals)).normals is not None
    contradictions = {
        "pitch_mm": np.float64(2.0 * heightmap.pitch_mm),
        "x_mm": heightmap.x_mm[::-1],
        "y_mm": np.full_like(heightmap.y_mm, np.nan),
        "depth_mm": 1e3 * heightmap.depth_mm,  # in micrometres
        "normals": normals_from_slopes(1e-2 * slope_x, slope_y),
        "source": np.array(["a.png", "b.png"]),
        "depth_scale_sd": np.array(np.nan),
        "flags": heightmap.flags[1:],
        "flag_names": np.array(["dark=2"]),
        "depth_sd_mm": np.full_like(heightmap.depth_mm, -1.0),
        "model": np.array([object()]).astype("S8"),
    }
    holed = heightmap.depth_mm.copy()
    holed[50, 50] = np.nan
    with pytest.raises(InputError, match="not finite"):
        read_npz(_written(heightmap, tmp_path, depth_mm=holed))
    for name, values in contradictions.items():
        with pytest.raises(InputError):
            read_npz(_written(heightmap, tmp_path, **{name: values}))


def test_a_small_file_cannot_ask_for_large_memory(tmp_path):
    path = _written(_ramp(), tmp_path)
    head = str({"descr": "<f4", "fortran_order": False, "shape": (10**10,)}).encode()
    with zipfile.ZipFile(path) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    members["depth_mm.npy"] = b"\x93NUMPY\x01\x00" + len(head).to_bytes(2, "little") + head
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in members.items():
            archive.writestr(name, data)
        archive.writestr("normals.npy", bytes(200_000_000))
    assert _memory_to_open(path) < 100e6
    # A part that declares 4 GB in the directory at the end of the file, and is not packed.
    whole = bytearray(_written(_ramp(), tmp_path).read_bytes())
    entry = whole.index(b"PK\x01\x02")
    whole[entry + 10 : entry + 12] = bytes(2)
    whole[entry + 20 : entry + 28] = struct.pack("<II", 2**32 - 2, 2**32 - 2)
    path.write_bytes(whole)
    assert _memory_to_open(path) < 100e6


def _memory_to_open(path: Path) -> int:
    """Return the memory that reading takes in a process of its own, whatever it reads."""
    script = (
        "import sys\nfrom contextlib import suppress\nfrom pathlib import Path\n"
        "from gelpolight_core.base.errors import InputError\n"
        "from gelpolight_core.output.raster import read_npz\n"
        "def asked(): return 1024 * int(Path('/proc/self/status').read_text()"
        ".split('VmPeak:')[1].split()[0])\n"
        "before = asked()\n"
        "with suppress(InputError): read_npz(Path(sys.argv[1]))\n"
        "print(asked() - before)"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, path], capture_output=True, text=True, check=True
    )
    return int(done.stdout)
