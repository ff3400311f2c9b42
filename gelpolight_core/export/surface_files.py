"""The surface in metres, for programs of surface metrology (X3P, SDF, GWY) and of robots (PCD).

The axes are those of the sensor, right-handed: x to the right, y down, z away from the camera. The
height is minus the depth; places without depth hold NaN.
"""

from __future__ import annotations

from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from gelpolight_core import __version__
from gelpolight_core.export.raster import extent_m, has_depth
from gelpolight_core.reconstruction.height_map import HeightMap


def _heights_m(heightmap: HeightMap) -> NDArray[np.float64]:
    return np.where(has_depth(heightmap), 1e-3 * heightmap.height_mm.astype(np.float64), np.nan)


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


def write_sdf(heightmap: HeightMap, file: BinaryIO) -> None:
    """Write SDF (ISO 25178-71), binary. The format has no place for the first pixel.

    Parameters
    ----------
    heightmap : HeightMap
        The height map.
    file : binary file
        Open for writing.
    """
    import sdfio  # only needed here

    pitch_m = 1e-3 * heightmap.pitch_mm
    about = sdfio.Metadata(manufacturer_id="GelPoLight", data_type=sdfio.DataType.BINARY32)
    sdfio.write(file, _heights_m(heightmap), x_scale=pitch_m, y_scale=pitch_m, metadata=about)


def write_gwy(heightmap: HeightMap, file: BinaryIO) -> None:
    """Write GWY, the file of Gwyddion: the depth in metres, with places without depth masked.

    Parameters
    ----------
    heightmap : HeightMap
        The height map.
    file : binary file
        Open for writing.
    """
    from gwyfile.objects import GwyContainer, GwyDataField, GwySIUnit  # only needed here

    known = has_depth(heightmap)
    names = ("xreal", "yreal", "xoff", "yoff")
    extent = dict(zip(names, extent_m(heightmap), strict=True))
    extent["si_unit_xy"] = GwySIUnit(unitstr="m")
    depth_m = np.where(known, 1e-3 * heightmap.depth_mm.astype(np.float64), 0.0)
    channel = GwyContainer(
        {
            "/0/data": GwyDataField(depth_m, **extent, si_unit_z=GwySIUnit(unitstr="m")),
            "/0/data/title": f"Depth {heightmap.source}",
            "/0/mask": GwyDataField(np.where(known, 0.0, 1.0), **extent),
        }
    )
    channel.tofile(file)


def write_pcd(heightmap: HeightMap, file: BinaryIO) -> None:
    """Write an organised PCD cloud in metres: a row of the cloud is a row of the map.

    Parameters
    ----------
    heightmap : HeightMap
        The height map.
    file : binary file
        Open for writing.

    References
    ----------
    Point Cloud Library, "The PCD (Point Cloud Data) file format", version 0.7.
    """
    rows, columns = heightmap.depth_mm.shape
    head = (
        "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nCOUNT 1 1 1\n"
        f"WIDTH {columns}\nHEIGHT {rows}\nVIEWPOINT 0 0 0 1 0 0 0\n"
        f"POINTS {rows * columns}\nDATA binary\n"
    )
    x, y = np.meshgrid(1e-3 * heightmap.x_mm, 1e-3 * heightmap.y_mm)
    file.write(head.encode())
    file.write(np.stack([x, y, _heights_m(heightmap)], axis=-1).astype("<f4").tobytes())
