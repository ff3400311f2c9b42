"""A height map as a picture of colours under a lamp."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.inspect import shading
from app.inspect.look import LEAST_RANGE_MM, Look, colour_table
from app.inspect.products import SURROUND
from gelpolight_core.reconstruction.heightmap import Flag, HeightMap


@dataclass(frozen=True, slots=True, eq=False)
class MapPicture:
    """What the view shows.

    Attributes
    ----------
    rgb : (rows, columns, 3) uint8
        Colours.
    range_mm : (low, high)
        Depths at the ends of the colours.
    """

    rgb: NDArray[np.uint8]
    range_mm: tuple[float, float]


def map_picture(heightmap: HeightMap, look: Look) -> MapPicture:
    """Return a height map with all its detail as colours."""
    depth = heightmap.depth_mm
    shown = look.range_mm or shading.automatic_range(depth, LEAST_RANGE_MM)
    table = colour_table(look.colours)
    rgb = shading.shaded(depth, heightmap.pitch_mm, table, shown, look.light)
    outside = heightmap.flags & np.uint8(Flag.OUTSIDE)
    return MapPicture(shading.outside_filled(rgb, outside, SURROUND), shown)
