"""A height map as a shaded colour image."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from app.view2d import shading
from app.view2d.colour_range import ColourRange
from app.view2d.display import SURROUND, Display, colour_table
from gelpolight_core.reconstruction.height_map import Flag, HeightMap


@dataclass(frozen=True, slots=True, eq=False)
class MapImage:
    """Content of the view.

    Attributes
    ----------
    rgb : (rows, columns, 3) uint8
        Colours.
    range_mm : (low, high)
        Depths at the ends of the colours.
    """

    rgb: NDArray[np.uint8]
    range_mm: tuple[float, float]


def map_image(heightmap: HeightMap, display: Display) -> MapImage:
    """Return a height map at full detail as colours."""
    depth = heightmap.depth_mm
    shown = display.range_mm or ColourRange().update(depth, 0.0)
    table = colour_table(display.colours)
    rgb = shading.shaded(depth, heightmap.pitch_mm, table, shown, display.light)
    outside = heightmap.flags & np.uint8(Flag.OUTSIDE)
    return MapImage(shading.outside_filled(rgb, outside, SURROUND), shown)
