"""A height map into files, one per format, named after its picture."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path, PurePath
from typing import BinaryIO

from gelpolight_core.errors import InputError
from gelpolight_core.export.atomic import make_folder, write_atomically
from gelpolight_core.export.mesh import Mesh, mesh_of, write_ply, write_stl, write_vtp
from gelpolight_core.export.raster import describe, write_gsf, write_npz, write_png16, write_tiff
from gelpolight_core.reconstruction.heightmap import HeightMap
from gelpolight_core.translation import tr

Writer = Callable[[BinaryIO], object]

RASTER_FORMATS = ("npz", "tif", "png", "gsf")
MESH_FORMATS = ("vtp", "ply", "stl")
FORMATS = (*RASTER_FORMATS, *MESH_FORMATS)


def ending(name: str) -> str:
    """Return the ending of a format's files, without its first dot."""
    return "depth.png" if name == "png" else name


def write_heightmap(
    heightmap: HeightMap, folder: Path, *, formats: Sequence[str], stride: int = 1
) -> list[Path]:
    """Write a height map as ``<folder>/<picture without ending>.<format>``, a file per format.

    Parameters
    ----------
    heightmap : HeightMap
        What to write.
    folder : Path
        Made when it is not there. Files of the same name are replaced, each whole or not at all.
    formats : sequence of str
        Out of :data:`FORMATS`: ``npz`` (everything), ``tif``, ``gsf`` and ``png`` (the
        depth; ``png`` in 16 bits with their scale, and named ``.depth.png``, since the camera's
        picture may stand beside it), ``vtp`` (mesh with depth, flags and normals), ``ply`` (the
        same), ``stl`` (bare mesh).
    stride : int, optional
        The meshes take every so many-th row and column only.

    Returns
    -------
    list of Path
        The files, in the order of `formats`.

    Raises
    ------
    InputError
        Where a format is unknown, a file cannot be written, or a mesh would be empty.
    """
    for name in formats:
        if name not in FORMATS:
            raise InputError(
                tr("the format {name} is not known").format(name=repr(name)),
                where=tr("export"),
                advice=tr("Choose from {names}").format(names=", ".join(FORMATS)),
            )
    surface = None
    if set(formats) & set(MESH_FORMATS):
        surface = mesh_of(heightmap, stride=stride)
    make_folder(folder)
    stem = PurePath(heightmap.source).stem or "heightmap"
    paths = [folder / f"{stem}.{ending(name)}" for name in formats]
    for name, path in zip(formats, paths, strict=True):
        write_atomically(path, _writer(name, heightmap, surface, stride))
    return paths


def _writer(name: str, heightmap: HeightMap, surface: Mesh | None, stride: int) -> Writer:
    if surface is None or name in RASTER_FORMATS:
        writers = {"npz": write_npz, "tif": write_tiff, "png": write_png16, "gsf": write_gsf}
        return partial(writers[name], heightmap)
    if name == "vtp":
        pitch_mm = heightmap.pitch_mm * stride
        return partial(write_vtp, surface, pitch_mm=pitch_mm, about=describe(heightmap))
    return partial({"ply": write_ply, "stl": write_stl}[name], surface)
