"""Write a height map to files, one per format, named after its image."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path, PurePath
from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from gelpolight_core import __version__
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.export.mesh import Mesh, mesh_of, write_gltf, write_ply, write_stl
from gelpolight_core.export.raster import write_csv, write_npz, write_png16, write_tiff
from gelpolight_core.io.atomic import make_folder, write_atomically
from gelpolight_core.plug_ins import EXPORTS, plug_ins
from gelpolight_core.reconstruction.height_map import HeightMap


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
