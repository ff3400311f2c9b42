"""The quantities that colour the surface in 3D: values, colours and scales."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from app.views.surface.display_surface import ColourScale
from app.widgets.units import round_up
from gelpolight_core.base.arrays import Float32Array
from gelpolight_core.base.compared_quantity import UNITS
from gelpolight_core.reconstruction.height_map import Flag, HeightMap

from .colour_tables import colour_table
from .map_point import FLAG_WORDS

STEEPEST_DEG = 60.0
LEAST_SD_UM = 1.0
LEAST_DIFFERENCE_MM = 0.01
NO_FLAG = (90, 96, 104)

FLAG_COLOURS = {
    Flag.INVALID: (225, 225, 225),
    Flag.NOT_OBSERVABLE: (255, 89, 94),
    Flag.DARK: (84, 125, 255),
    Flag.SATURATED: (255, 0, 255),
    Flag.EXTRAPOLATED: (255, 202, 58),
    Flag.UNANCHORED: (150, 110, 190),
}
"""Colour of each flag, the most serious first."""


@dataclass(frozen=True, slots=True, eq=False)
class ReferenceMap:
    """A height map for comparison. Two are equal only if they are the same object."""

    heightmap: HeightMap
    name: str = ""


def depth_scale(colours: str, range_mm: tuple[float, float], title: str = "") -> ColourScale:
    """Return the scale of depths."""
    return ColourScale(title or "depth (mm)", colour_table(colours), *range_mm)


def slope_scale() -> ColourScale:
    """Return the scale of slopes in degrees."""
    return ColourScale("slope (°)", colour_table("magma"), 0.0, STEEPEST_DEG)


def uncertainty_scale(sd_um: Float32Array) -> ColourScale:
    """Return the scale of standard deviations in µm. One pixel in a hundred is above it."""
    top = float(np.percentile(sd_um, 99.0)) if sd_um.size else LEAST_SD_UM
    top = round_up(max(round(top, 4), LEAST_SD_UM))
    return ColourScale(f"1 sd [{UNITS['um']}]", colour_table("inferno"), 0.0, top)


def flag_scale() -> ColourScale:
    """Return the colours of the flags, with their names."""
    names = [(FLAG_WORDS[flag], colour) for flag, colour in FLAG_COLOURS.items()]
    table = np.full((256, 3), NO_FLAG, np.uint8)
    return ColourScale("flags", table, 0.0, 1.0, (("no flags", NO_FLAG), *names))


def difference_scale(difference_mm: Float32Array, title: str = "") -> ColourScale:
    """Return a scale for differences in mm, with zero in its middle."""
    sizes = np.abs(difference_mm[np.isfinite(difference_mm)])
    top = float(np.percentile(sizes, 99.9)) if sizes.size else LEAST_DIFFERENCE_MM
    top = round_up(max(round(top, 5), LEAST_DIFFERENCE_MM))
    title = title or "difference (mm)"
    return ColourScale(title, colour_table("CET-D1"), -top, top)
