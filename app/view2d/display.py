"""Display settings of depth: colours, range, light, contour lines."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray

from gelpolight_core.fields import choice, number, switch

LIMITS_MM = -1.0, 5.0
"""Limits of a colour range that the user sets."""
SURROUND = (21, 23, 26)
"""Around an image, in both themes: dark images can only be judged against a dark surround."""


COLOUR_MAPS = {
    "viridis": "Viridis",
    "cividis": "Cividis (colour-blind safe)",
    "inferno": "Inferno",
    "magma": "Magma",
    "CET-L1": "Grey",
    "plasma": "Plasma",
}
"""Perceptually uniform colour maps, by their names in pyqtgraph."""
QUANTITIES = {
    "depth": "Depth",
    "slope": "Slope",
    "uncertainty": "Uncertainty (when paused)",
    "flags": "Flags",
    "difference": "Difference from the reference",
}
"""Quantities that can colour the 3D surface."""
KEEP_RANGE = "Keep the colour range. If unlocked, it follows the deepest press"


@dataclass(frozen=True, slots=True)
class Display:
    """Display settings that all views of the depth share.

    Attributes
    ----------
    colours : str
        One of COLOUR_MAPS.
    colour_by : str
        Quantity shown by the colours in 3D: one of QUANTITIES.
    locked : bool
        Whether the colours have the range from `low_mm` to `high_mm`, not the automatic one.
    low_mm, high_mm : float
        Depths at the ends of a locked range.
    contour_mm : float
        Depth between contour lines. 0: none.
    relief : bool
        Whether the height map is shaded.
    exaggeration : float
        Scale of depth relative to width in 3D.
    azimuth_deg, elevation_deg : float
        Direction of the lamp that shades the relief: from the upper edge of the image, clockwise
        (315 is the upper left), and above the surface.
    """

    colours: str = choice("viridis", "Colours", COLOUR_MAPS)
    colour_by: str = choice("depth", "Colour by", QUANTITIES)
    locked: bool = switch(False, "Range", "Lock", KEEP_RANGE, "K")
    low_mm: float = number(0.0, "From", *LIMITS_MM, " mm", 2, step=0.1, when=lambda d: d.locked)
    high_mm: float = number(1.0, "To", *LIMITS_MM, " mm", 2, step=0.1, when=lambda d: d.locked)
    contour_mm: float = number(0.0, "Contours", 0.0, LIMITS_MM[1], " mm", 2, step=0.05, none="none")
    relief: bool = switch(True, "", "Shade the height map")
    exaggeration: float = number(3.0, "Stretch", 1.0, 8.0, decimals=1, slider=True)
    azimuth_deg: float = number(315.0, "Light", 0.0, 359.0, slider=True)
    elevation_deg: float = number(45.0, "Elevation", 15.0, 85.0, slider=True)

    @property
    def range_mm(self) -> tuple[float, float] | None:
        """Depths at the ends of the colours. None: the automatic range (`ColourRange`)."""
        return (self.low_mm, max(self.high_mm, self.low_mm + 0.01)) if self.locked else None

    @property
    def light(self) -> tuple[float, float, float]:
        """Unit vector towards the lamp: x right, y down, z out of the surface."""
        azimuth, height = np.radians([self.azimuth_deg, self.elevation_deg])
        across = np.cos(height)
        x, y, z = across * np.sin(azimuth), -across * np.cos(azimuth), np.sin(height)
        return float(x), float(y), float(z)


@lru_cache(maxsize=16)
def colour_table(name: str) -> NDArray[np.uint8]:
    """Return a colour map as (256, 3) uint8, RGB."""
    table = pg.colormap.get(name).getLookupTable(nPts=256, mode="byte", alpha=False)
    return np.ascontiguousarray(table[:, :3], np.uint8)
