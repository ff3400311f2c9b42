"""Height maps in the formats of other programs."""

import json
import struct
import zlib
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from gelpolight_core.base.errors import InputError
from gelpolight_core.output.formats import HEIGHT_MAP_FORMATS
from gelpolight_core.output.heightmap_files import write_heightmap
from gelpolight_core.output.mesh_files import mesh_of
from gelpolight_core.reconstruction.height_map import FLAG_NAMES, SD_MAPS, Flag, HeightMap
from tests.measurement.maps import on_grid

ROWS, COLUMNS, PITCH_MM = 17, 23, 0.125


@pytest.fixture
def heightmap():
    """Return an uneven dent, off-centre, in a working area that is not the whole grid."""
    x_mm = -1.25 + PITCH_MM * np.arange(COLUMNS)
    y_mm = -0.75 + PITCH_MM * np.arange(ROWS)
    x, y = np.meshgrid(x_mm, y_mm)
    depth = 0.4 * np.exp(-((x - 0.2) ** 2) / 0.9 - (y - 0.1) ** 2 / 0.4)
    slopes = np.stack([-2 * (x - 0.2) / 0.9 * depth, -2 * (y - 0.1) / 0.4 * depth], axis=-1)
    normals = np.concatenate([-slopes, -np.ones((ROWS, COLUMNS, 1))], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    flags = np.where(np.hypot(x, y) > 1.2, Flag.OUTSIDE.value, 0).astype(np.uint8)
    flags[5, 7] |= Flag.DARK.value | Flag.EXTRAPOLATED.value
    made = on_grid(depth.astype(np.float32), x_mm, y_mm, flags)
    normals = normals.astype(np.float32)
    return replace(made, normals=normals, calibration_id="A-001 <2> & µ", source="press_03.png")


def write_one(heightmap: HeightMap, folder: Path, name: str, **options: int) -> Path:
    """Write one format and return the file."""
    (path,) = write_heightmap(heightmap, folder, formats=[name], **options)
    return path


def test_one_file_per_format_named_after_the_image(tmp_path, heightmap):
    folder = tmp_path / "new" / "folder"
    paths = write_heightmap(heightmap, folder, formats=tuple(HEIGHT_MAP_FORMATS))
    assert paths == [folder / f"press_03{f.suffix}" for f in HEIGHT_MAP_FORMATS.values()]
    assert all(map(Path.is_file, paths))


@pytest.mark.function("Write standard deviations into npz")
def test_npz_contains_standard_deviations_if_there_are_any(tmp_path, heightmap):
    with np.load(write_one(heightmap, tmp_path, "npz")) as found:
        assert not {*SD_MAPS, "depth_scale_sd", "lateral_scale_sd"} & set(found)
    maps = {name: heightmap.depth_mm + np.float32(k) for k, name in enumerate(SD_MAPS)}
    stated = replace(heightmap, **maps, depth_scale_sd=0.006, lateral_scale_sd=0.0)
    with np.load(write_one(stated, tmp_path, "npz")) as found:
        for name, values in maps.items():
            assert np.array_equal(found[name], values)
        assert (float(found["depth_scale_sd"]), float(found["lateral_scale_sd"])) == (0.006, 0.0)
    with pytest.raises(ValueError, match="depth_sd_mm"):
        replace(heightmap, depth_sd_mm=heightmap.depth_mm[1:])


@pytest.mark.function("Write npz with depth, normals, flags, units and places")
def test_npz_contains_everything_without_pickles(tmp_path, heightmap):
    with np.load(write_one(heightmap, tmp_path, "npz"), allow_pickle=False) as found:
        assert found["depth_mm"].dtype == np.float32
        assert found["flags"].dtype == np.uint8
        for name in ("depth_mm", "x_mm", "y_mm", "normals", "flags"):
            assert np.array_equal(found[name], getattr(heightmap, name))
        assert float(found["pitch_mm"]) == PITCH_MM
        for name in ("calibration_id", "model", "source"):
            assert str(found[name]) == getattr(heightmap, name)
        bits = dict(entry.split("=") for entry in found["flag_names"].tolist())
    assert {name: int(bit) for name, bit in bits.items()} == dict(FLAG_NAMES)
    assert bits["dark"] == "4"


@pytest.mark.function("Write TIFF and PNG with their scale")
def test_tiff_is_read_by_other_programs_with_its_scale(tmp_path, heightmap):
    path = write_one(heightmap, tmp_path, "tif")
    depth = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert depth.dtype == np.float32
    assert np.array_equal(depth, heightmap.depth_mm)
    with tifffile.TiffFile(path) as tiff:
        (page,) = tiff.pages
        tags = {name: page.tags[name].value for name in ("XResolution", "YResolution")}
        assert page.tags["ResolutionUnit"].value == 3  # centimetre
        about = json.loads(page.description)
    for over, under in tags.values():
        assert over / under == pytest.approx(10 / PITCH_MM, rel=1e-6)
    assert about["unit"] == "mm"
    assert (about["pitch_mm"], about["x0_mm"], about["y0_mm"]) == (PITCH_MM, -1.25, -0.75)
    assert about["calibration_id"] == heightmap.calibration_id


def png_chunks(path: Path) -> list[tuple[bytes, bytes]]:
    """Return the chunks of a PNG file by its published format, their checksums checked."""
    data = path.read_bytes()
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    chunks, at = [], 8
    while at < len(data):
        (length,) = struct.unpack(">I", data[at : at + 4])
        body = data[at + 4 : at + 8 + length]
        assert struct.unpack(">I", data[at + 8 + length : at + 12 + length])[0] == zlib.crc32(body)
        chunks.append((body[:4], body[4:]))
        at += 12 + length
    return chunks


@pytest.mark.parametrize("hole", [False, True])
def test_png_keeps_depths_within_half_a_step_and_says_its_scale(tmp_path, heightmap, hole):
    depth_mm = heightmap.depth_mm.copy()
    if hole:
        depth_mm[3, 4], depth_mm[8, 2] = np.nan, np.inf
    path = write_one(replace(heightmap, depth_mm=depth_mm), tmp_path, "png")
    chunks = png_chunks(path)
    assert [kind for kind, _ in chunks][:3] == [b"IHDR", b"pHYs", b"tEXt"]
    value = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    assert value.dtype == np.uint16
    keyword, text = dict(chunks)[b"tEXt"].split(b"\0", 1)
    about = json.loads(text)
    known = np.isfinite(depth_mm)
    assert np.array_equal(value == about["unknown"], ~known)
    found = about["offset_mm"] + about["step_mm"] * value[known].astype(float)
    half = 0.5 * about["step_mm"]
    assert found == pytest.approx(depth_mm[known].astype(float), abs=half * (1 + 1e-9))
    assert about["step_mm"] == pytest.approx(np.ptp(depth_mm[known]) / 65534, rel=1e-4)
    assert keyword == b"GelPoLight"
    assert about["calibration_id"] == heightmap.calibration_id
    assert (about["pitch_mm"], about["x0_mm"], about["y0_mm"]) == (PITCH_MM, -1.25, -0.75)
    assert struct.unpack(">IIB", dict(chunks)[b"pHYs"]) == (8000, 8000, 1)


def surface_area_vectors(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return (M, 3) twice the area of each triangle, along the normal its winding gives."""
    a, b, c = np.moveaxis(points[triangles], 1, 0).astype(float)
    return np.cross(b - a, c - a)


@pytest.mark.parametrize("name", ["ply", "stl"])
def test_meshes_are_the_surface_within_the_working_area(tmp_path, heightmap, name):
    read = pytest.importorskip("pyvista").read(write_one(heightmap, tmp_path, name))
    points, triangles = np.asarray(read.points), read.faces.reshape(-1, 4)[:, 1:]
    columns = np.rint((points[:, 0] - heightmap.x_mm[0]) / PITCH_MM).astype(int)
    rows = np.rint((points[:, 1] - heightmap.y_mm[0]) / PITCH_MM).astype(int)
    assert points[:, 0] == pytest.approx(heightmap.x_mm[columns], abs=1e-6)
    assert points[:, 1] == pytest.approx(heightmap.y_mm[rows], abs=1e-6)
    assert points[:, 2] == pytest.approx(-heightmap.depth_mm[rows, columns], abs=1e-6)
    assert not (heightmap.flags[rows, columns] & Flag.OUTSIDE).any()
    inside = (heightmap.flags & Flag.OUTSIDE) == 0
    whole = inside[1:, 1:] & inside[1:, :-1] & inside[:-1, 1:] & inside[:-1, :-1]
    assert 0 < whole.sum() < whole.size
    assert len(triangles) == 2 * whole.sum()
    vectors = surface_area_vectors(points, triangles)
    assert -vectors[:, 2].sum() / 2 == pytest.approx(whole.sum() * PITCH_MM**2, rel=1e-6)
    assert (vectors[:, 2] < 0).all()  # the normals point towards the camera
    if heightmap.normals is not None and name != "stl":
        own = heightmap.normals[rows, columns][triangles].mean(axis=1)
        unit = vectors / np.linalg.norm(vectors, axis=1, keepdims=True)
        assert (np.sum(unit * own, axis=1) > 0.9).all()


def test_ply_carries_depth_flags_and_normals(tmp_path, heightmap):
    surface, found = mesh_of(heightmap), read_ply(write_one(heightmap, tmp_path, "ply"))
    assert np.array_equal(found["depth_mm"], surface.depth_mm)
    assert np.array_equal(found["flags"], surface.flags)
    assert found["normals"] == pytest.approx(surface.normals, abs=1e-6)
    assert Flag.DARK | Flag.EXTRAPOLATED in found["flags"]


def read_ply(path: Path) -> dict[str, np.ndarray]:
    """Return the point data of a binary PLY, byte by byte from its header."""
    header, data = path.read_bytes().split(b"end_header\n", 1)
    assert header.startswith(b"ply\nformat binary_little_endian 1.0\n")
    vertex, _, rest = header.decode().partition("element vertex ")[2].partition("\n")
    kinds = {"float": "<f4", "double": "<f8", "uchar": "u1", "uint8": "u1"}
    lines = (line.split() for line in rest.partition("element")[0].splitlines())
    points = np.frombuffer(data, [(name, kinds[kind]) for _, kind, name in lines], int(vertex))
    normals = np.stack([points[name] for name in ("nx", "ny", "nz")], axis=-1)
    return {name: points[name] for name in ("depth_mm", "flags")} | {"normals": normals}


@given(
    arrays.arrays(bool, st.tuples(st.integers(2, 12), st.integers(2, 12)), fill=st.just(False)),
    st.integers(1, 5),
)
def test_a_thinned_mesh_leaves_out_every_cell_with_a_pixel_outside(outside, stride):
    rows, columns = outside.shape
    flags = (outside * Flag.OUTSIDE).astype(np.uint8)
    x, y = np.arange(columns, dtype=float), np.arange(rows, dtype=float)
    heightmap = on_grid(np.zeros(flags.shape, np.float32), x, y, flags)
    expected = {
        (row, column)
        for row in range(0, rows - stride, stride)
        for column in range(0, columns - stride, stride)
        if not outside[row : row + stride + 1, column : column + stride + 1].any()
    }
    if not expected:
        with pytest.raises(InputError, match="working area"):
            mesh_of(heightmap, stride=stride)
        return
    mesh = mesh_of(heightmap, stride=stride)
    lowest = mesh.points_mm[mesh.triangles].min(axis=1)
    cells = [(int(y), int(x)) for x, y, _ in lowest]
    assert set(cells) == expected
    assert len(cells) == 2 * len(expected)
    assert set(mesh.triangles.ravel()) == set(range(len(mesh.points_mm)))


def test_a_pixel_without_finite_depth_makes_a_hole_not_a_broken_mesh(heightmap):
    depth_mm = heightmap.depth_mm.copy()
    depth_mm[8, 10] = np.nan
    mesh = mesh_of(replace(heightmap, depth_mm=depth_mm))
    assert np.isfinite(mesh.points_mm).all()
    assert len(mesh.triangles) == len(mesh_of(heightmap).triangles) - 8


def test_an_unknown_format_is_refused_before_anything_is_written(tmp_path, heightmap):
    with pytest.raises(InputError, match=r"'docx'.*npz"):
        write_heightmap(heightmap, tmp_path / "out", formats=["npz", "docx"])
    assert not list(tmp_path.iterdir())


@pytest.mark.function("Write CSV")
def test_csv_is_a_table_with_its_places_and_gaps(tmp_path, heightmap):
    rows = [line.split(",") for line in write_one(heightmap, tmp_path, "csv").read_text().split()]
    assert rows[0][0] == "depth_mm"
    np.testing.assert_allclose([float(x) for x in rows[0][1:]], heightmap.x_mm, atol=1e-6)
    np.testing.assert_allclose([float(row[0]) for row in rows[1:]], heightmap.y_mm, atol=1e-6)
    read = np.array([[float(cell or "nan") for cell in row[1:]] for row in rows[1:]])
    outside = (heightmap.flags & Flag.OUTSIDE.value) != 0
    np.testing.assert_array_equal(np.isnan(read), outside)
    np.testing.assert_allclose(read[~outside], heightmap.depth_mm[~outside], rtol=1e-5, atol=1e-9)
