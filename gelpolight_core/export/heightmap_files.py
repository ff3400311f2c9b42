"""Write a height map to files, one per format, named after its image."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path, PurePath
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.export.raster import write_csv, write_npz, write_png16, write_tiff
from gelpolight_core.io.atomic import make_folder, write_atomically
from gelpolight_core.plug_ins import EXPORTS, plug_ins
from gelpolight_core.reconstruction.height_map import Flag, HeightMap
from gelpolight_core.version import __version__


@dataclass(frozen=True, slots=True)
class Mesh:
    """Triangle mesh of the membrane in the sensor frame.

    Attributes
    ----------
    points_mm : (N, 3) float32
        (x, y, height over the plane of the boundary).
    triangles : (M, 3) int32
        Corners, counter-clockwise seen from the camera: the normals point towards it (z < 0).
    depth_mm : (N,) float32
    flags : (N,) uint8
    normals : (N, 3) float32 or None
    """

    points_mm: NDArray[np.float32]
    triangles: NDArray[np.int32]
    depth_mm: NDArray[np.float32]
    flags: NDArray[np.uint8]
    normals: NDArray[np.float32] | None


def mesh_of(heightmap: HeightMap, *, stride: int = 1) -> Mesh:
    """Return the surface as triangles, two to each cell of the grid.

    A cell is left out when any pixel in it is flagged as outside or has no finite depth; points
    that no cell uses are left out too.

    Parameters
    ----------
    heightmap : HeightMap
        The surface.
    stride : int, optional
        Use only every n-th row and column, for smaller files.

    Raises
    ------
    ValueError
        If `stride` is below 1.
    InputError
        If no cell is left.
    """
    if stride < 1:
        raise ValueError(f"stride = {stride}, expected 1 or more")
    depth_mm = heightmap.depth_mm[::stride, ::stride].astype(np.float32)
    used = ~_bad_cells(heightmap, stride)
    if not used.any():
        raise InputError(
            "No part of the surface is in the working area", heightmap.source, Remedy.CHECK_AREA
        )
    first = np.arange(depth_mm.size, dtype=np.int32).reshape(depth_mm.shape)
    corner, right, below, across = (
        part[used] for part in (first[:-1, :-1], first[:-1, 1:], first[1:, :-1], first[1:, 1:])
    )
    triangles = np.stack([corner, below, right, right, below, across], axis=-1).reshape(-1, 3)
    kept = np.zeros(depth_mm.size, dtype=bool)
    kept[triangles] = True
    numbers = np.cumsum(kept, dtype=np.int32) - np.int32(1)
    x_mm, y_mm = np.meshgrid(heightmap.x_mm[::stride], heightmap.y_mm[::stride])
    height_mm = heightmap.height_mm[::stride, ::stride]
    points_mm = np.stack([x_mm, y_mm, height_mm], axis=-1, dtype=np.float32, casting="same_kind")
    normals = heightmap.normals
    if normals is not None:
        normals = normals[::stride, ::stride].reshape(-1, 3)[kept].astype(np.float32)
    return Mesh(
        points_mm=points_mm.reshape(-1, 3)[kept],
        triangles=numbers[triangles],
        depth_mm=depth_mm.ravel()[kept],
        flags=heightmap.flags[::stride, ::stride].ravel()[kept],
        normals=normals,
    )


def _bad_cells(heightmap: HeightMap, stride: int) -> NDArray[np.bool_]:
    """Cells of the thinned grid with any pixel, corners included, that cannot be part of a mesh."""
    bad = (heightmap.flags & Flag.OUTSIDE.value).astype(bool) | ~np.isfinite(heightmap.depth_mm)
    for _ in range(2):
        cells = max((bad.shape[0] - 1) // stride, 0)
        reach = [bad[k : k + cells * stride : stride] for k in range(stride + 1)]
        bad = np.logical_or.reduce(reach).T
    return bad


def write_ply(mesh: Mesh, file: BinaryIO) -> None:
    """Write a binary PLY with normals, depth and flags on each point.

    Parameters
    ----------
    mesh : Mesh
        The mesh.
    file : binary file
        Open for writing.
    """
    from trimesh.exchange.ply import export_ply  # slow to import, and only needed here

    surface = _as_trimesh(mesh)
    surface.vertex_attributes["depth_mm"] = mesh.depth_mm
    surface.vertex_attributes["flags"] = mesh.flags
    file.write(export_ply(surface, vertex_normal=mesh.normals is not None))


def write_stl(mesh: Mesh, file: BinaryIO) -> None:
    """Write a binary STL: triangles only.

    Parameters
    ----------
    mesh : Mesh
        The mesh.
    file : binary file
        Open for writing.
    """
    from trimesh.exchange.stl import export_stl

    file.write(export_stl(_as_trimesh(mesh)))


def write_gltf(mesh: Mesh, file: BinaryIO) -> None:
    """Write a binary glTF. The vertices are in mm; the node scales them to metres.

    Parameters
    ----------
    mesh : Mesh
        The mesh.
    file : binary file
        Open for writing.
    """
    import trimesh
    from trimesh.exchange.gltf import export_glb

    scene = trimesh.Scene()
    scene.add_geometry(
        _as_trimesh(mesh), node_name="membrane", transform=np.diag([1e-3, 1e-3, 1e-3, 1.0])
    )
    content = export_glb(scene, include_normals=mesh.normals is not None)  # type: ignore[no-untyped-call]
    file.write(content)


def _as_trimesh(mesh: Mesh):  # type: ignore[no-untyped-def]
    import trimesh

    return trimesh.Trimesh(
        vertices=mesh.points_mm,
        faces=mesh.triangles,
        vertex_normals=mesh.normals,
        process=False,
        validate=False,
    )


def _heights_m(heightmap: HeightMap) -> NDArray[np.float64]:
    """Return the heights (rows, columns) over the plane of the boundary, NaN without depth."""
    return np.where(heightmap.known, 1e-3 * heightmap.height_mm.astype(np.float64), np.nan)


def write_x3p(heightmap: HeightMap, file: BinaryIO) -> None:
    """Write X3P (ISO 25178-72), with the place of the first pixel and the calibration.

    Parameters
    ----------
    heightmap : HeightMap
        The height map.
    file : binary file
        Open for writing.
    """
    import x3pio  # only needed here

    pitch_m = 1e-3 * heightmap.pitch_mm
    x3pio.write(
        file,
        _heights_m(heightmap),
        x_scale=pitch_m,
        y_scale=pitch_m,
        z_type=x3pio.DataType.FLOAT32,
        placement=x3pio.Placement.translation(
            1e-3 * float(heightmap.x_mm[0]), 1e-3 * float(heightmap.y_mm[0]), 0.0
        ),
        coordinate_system=x3pio.CoordinateSystem.VIEW,
        metadata=x3pio.Metadata(
            instrument=x3pio.Instrument("GelPoLight", heightmap.model, "", __version__),
            probing_system=x3pio.ProbingSystem(
                x3pio.ProbingType.CONTACTING, "photometric stereo of a pressed membrane"
            ),
            comment=f"{heightmap.source}, calibration {heightmap.calibration_id}",
        ),
    )


def write_gwy(heightmap: HeightMap, file: BinaryIO) -> None:
    """Write GWY, the file of Gwyddion: heights in metres, with places without depth masked.

    Parameters
    ----------
    heightmap : HeightMap
        The height map.
    file : binary file
        Open for writing.
    """
    from gwyfile.objects import GwyContainer, GwyDataField, GwySIUnit  # only needed here

    heights_m, pitch_m = _heights_m(heightmap), 1e-3 * heightmap.pitch_mm
    rows, columns = heights_m.shape
    # Gwyddion's lengths go from outline to outline: half a pixel beyond the outermost centres.
    extent = {
        "xreal": columns * pitch_m,
        "yreal": rows * pitch_m,
        "xoff": 1e-3 * float(heightmap.x_mm[0]) - pitch_m / 2,
        "yoff": 1e-3 * float(heightmap.y_mm[0]) - pitch_m / 2,
        "si_unit_xy": GwySIUnit(unitstr="m"),
    }
    channel = GwyContainer(
        {
            "/0/data": GwyDataField(
                np.nan_to_num(heights_m), **extent, si_unit_z=GwySIUnit(unitstr="m")
            ),
            "/0/data/title": f"Height {heightmap.source}",
            "/0/mask": GwyDataField(np.where(np.isnan(heights_m), 1.0, 0.0), **extent),
        }
    )
    channel.tofile(file)


Writer = Callable[[BinaryIO], object]

RASTER_FORMATS: dict[str, Callable[..., object]] = {
    **plug_ins(EXPORTS),  # first, so that none replaces one of ours
    "npz": write_npz,
    "tif": write_tiff,
    "png": write_png16,
    "gwy": write_gwy,
    "x3p": write_x3p,
    "csv": write_csv,
}
MESH_FORMATS: dict[str, Callable[..., object]] = {
    "ply": write_ply,
    "stl": write_stl,
    "glb": write_gltf,
}
FORMATS = (*RASTER_FORMATS, *MESH_FORMATS)


def ending(name: str) -> str:
    """Return the extension of a format's files, without its first dot."""
    return "depth.png" if name == "png" else name


def write_heightmap(
    heightmap: HeightMap, folder: Path, *, formats: Sequence[str] | str, stride: int = 1
) -> list[Path]:
    """Write a height map as ``<folder>/<image without extension>.<format>``, one file per format.

    Parameters
    ----------
    heightmap : HeightMap
        The height map.
    folder : Path
        Created if it does not exist. Files of the same name are replaced, each completely or not at
        all.
    formats : sequence of str, or one of them
        Out of :data:`FORMATS`: ``npz`` (all maps), ``csv`` (the depth as a table, with the
        places of columns and rows), ``tif`` and ``png`` (the depth; ``png`` in 16 bits with its
        scale, and named ``.depth.png``, since the camera image may be in the same folder),
        ``gwy`` and ``x3p`` (the height of the surface in metres), ``ply`` (mesh with depth, flags
        and normals), ``stl`` (bare mesh), ``glb`` (glTF, in metres).
    stride : int, optional
        Meshes use only every n-th row and column.

    Returns
    -------
    list of Path
        The files, in the order of `formats`.

    Raises
    ------
    InputError
        If a format is unknown, a file cannot be written, or a mesh would be empty.
    """
    formats = (formats,) if isinstance(formats, str) else formats
    for name in formats:
        if name not in FORMATS:
            raise InputError(
                f"The format {name!r} is unknown",
                "export",
                Remedy.ONE_OF.format(names=", ".join(FORMATS)),
            )
    surface = mesh_of(heightmap, stride=stride) if MESH_FORMATS.keys() & formats else None
    make_folder(folder)
    stem = PurePath(heightmap.source).stem or "heightmap"
    paths = [folder / f"{stem}.{ending(name)}" for name in formats]
    for name, path in zip(formats, paths, strict=True):
        write_atomically(path, _writer(name, heightmap, surface))
    return paths


def _writer(name: str, heightmap: HeightMap, surface: Mesh | None) -> Writer:
    if surface is None or name in RASTER_FORMATS:
        return partial(RASTER_FORMATS[name], heightmap)
    return partial(MESH_FORMATS[name], surface)
