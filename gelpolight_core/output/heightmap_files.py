"""Write height maps and profiles in the formats of :mod:`gelpolight_core.output.formats`."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path, PurePath

from gelpolight_core.base.atomic_write import make_folder, write_atomically
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.measurement.profile import Profile
from gelpolight_core.reconstruction.height_map import HeightMap

from .formats import HEIGHT_MAP_FORMATS, PROFILE_FORMATS
from .mesh_files import Mesh, mesh_of


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
        Keys of :data:`~gelpolight_core.output.formats.HEIGHT_MAP_FORMATS`.
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
    keys = (formats,) if isinstance(formats, str) else formats
    for key in keys:
        if key not in HEIGHT_MAP_FORMATS:
            raise InputError(
                f"The format {key!r} is unknown",
                "export",
                Remedy.ONE_OF.format(names=", ".join(HEIGHT_MAP_FORMATS)),
            )
    rows = [HEIGHT_MAP_FORMATS[key] for key in keys]
    has_mesh = any(row.of is Mesh for row in rows)
    mesh = mesh_of(heightmap, stride=stride) if has_mesh else None
    make_folder(folder)
    stem = PurePath(heightmap.source).stem or "heightmap"
    paths = [folder / f"{stem}{row.suffix}" for row in rows]
    for row, path in zip(rows, paths, strict=True):
        write_atomically(path, partial(row.write, mesh if row.of is Mesh else heightmap))
    return paths


def write_profile(profile: Profile, path: Path) -> None:
    """Write a profile in the format of the file's extension, or else as CSV.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    row = PROFILE_FORMATS.get(path.suffix[1:].lower(), PROFILE_FORMATS["csv"])
    write_atomically(path, partial(row.write, profile))
