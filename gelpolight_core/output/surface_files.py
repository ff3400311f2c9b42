"""Files that hold the height of the surface for metrology: X3P and GWY."""

from __future__ import annotations

from typing import BinaryIO

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.version import __version__
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
