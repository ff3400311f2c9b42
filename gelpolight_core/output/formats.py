"""The export formats. Commands, save dialogs and documentation read this one table.

To add a format, write its writer and its row in `FORMATS`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from inspect import getdoc
from typing import Any, BinaryIO

from gelpolight_core.base.plugins import EXPORTS, plug_ins
from gelpolight_core.measurement.profile import Profile
from gelpolight_core.reconstruction.height_map import HeightMap

from .mesh_files import Mesh, write_gltf, write_ply, write_stl
from .profile_file import write_profile_csv
from .raster import write_csv, write_npz, write_png16, write_tiff
from .surface_files import write_gwy, write_x3p


@dataclass(frozen=True, slots=True)
class Format:
    """File format of a result.

    Attributes
    ----------
    key : str
        Its name in commands. Unique among the formats of a height map and among those of a profile.
    write : callable
        Writes the content into an open binary file.
    title : str
        What the file holds, and for which programs.
    of : type
        Class of the content: a height map, its mesh, or a profile.
    extension : str
        Extension of the file, without its first dot, where it is not the key.
    """

    key: str
    write: Callable[[Any, BinaryIO], object]
    title: str
    of: type[HeightMap | Mesh | Profile]
    extension: str = ""

    @property
    def suffix(self) -> str:
        """The end of its file names."""
        return f".{self.extension or self.key}"

    @property
    def label(self) -> str:
        """Key and title."""
        return f"{self.key}: {self.title}"


FORMATS = (
    Format("npz", write_npz, "all data with flags, units and checksum, for NumPy", HeightMap),
    Format("tif", write_tiff, "depth in mm, 32-bit float", HeightMap),
    # The camera image may be in the same folder.
    Format("png", write_png16, "depth, 16-bit with its scale", HeightMap, extension="depth.png"),
    Format("gwy", write_gwy, "height of the surface in metres, for Gwyddion", HeightMap),
    Format(
        "x3p",
        write_x3p,
        "height of the surface in metres, for metrology (ISO 25178-72)",
        HeightMap,
    ),
    Format("csv", write_csv, "depth in mm as a table, for spreadsheets", HeightMap),
    Format("ply", write_ply, "mesh in mm with depth, flags and normals, for ParaView", Mesh),
    Format("stl", write_stl, "mesh in mm, for 3D printing", Mesh),
    Format("glb", write_gltf, "glTF mesh in metres, for 3D viewers and web pages", Mesh),
    Format("csv", write_profile_csv, "depth along a line, for spreadsheets", Profile),
)

HEIGHT_MAP_FORMATS = {
    **{
        name: Format(name, write, (getdoc(write) or "").partition("\n")[0].rstrip("."), HeightMap)
        for name, write in plug_ins(EXPORTS).items()
    },
    # After those of other packages, so that none replaces one of ours.
    **{format.key: format for format in FORMATS if format.of is not Profile},
}
"""The formats of a height map by their keys, with those of installed packages."""
PROFILE_FORMATS = {format.key: format for format in FORMATS if format.of is Profile}
"""The formats of a profile by their keys."""
