"""Display settings of depth: colours, range, light, contour lines."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, field
from functools import lru_cache

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray

from gelpolight_core.translation import tr

COLOUR_MAPS = ("viridis", "cividis", "inferno", "magma", "CET-L1", "plasma")
"""Perceptually uniform colour maps, by their names in pyqtgraph."""
QUANTITIES = ("depth", "slope", "uncertainty", "flags", "difference")
"""Quantities that can colour the 3D surface."""
LIMITS_MM = -1.0, 5.0
"""Limits of a colour range that the user sets."""
SURROUND = (21, 23, 26)
"""Around an image, in both themes: dark images can only be judged against a dark surround."""


def colour_map_labels() -> dict[str, str]:
    """Return the label of each colour map."""
    return {
        "viridis": tr("Viridis"),
        "cividis": tr("Cividis (colour-blind safe)"),
        "inferno": tr("Inferno"),
        "magma": tr("Magma"),
        "CET-L1": tr("Grey"),
        "plasma": tr("Plasma"),
    }


@dataclass(frozen=True, slots=True)
class Light:
    """Position of the lamp that shades the relief.

    Attributes
    ----------
    azimuth_deg : float
        From the upper edge of the image, clockwise. 315 is the upper left.
    height_deg : float
        Above the surface.
    """

    azimuth_deg: float = 315.0
    height_deg: float = 45.0

    def direction(self) -> NDArray[np.float64]:
        """Return the unit vector towards the lamp: x right, y down, z out of the surface."""
        azimuth, height = np.radians([self.azimuth_deg, self.height_deg])
        across = np.cos(height)
        return np.array([across * np.sin(azimuth), -across * np.cos(azimuth), np.sin(height)])


@dataclass(frozen=True, slots=True)
class Display:
    """Display settings that all views of the depth share.

    Attributes
    ----------
    colours : str
        One of COLOUR_MAPS.
    range_mm : (low, high) or None
        Depths at the ends of the colours. None: the automatic range (`ColourRange`).
    contour_mm : float
        Depth between contour lines. 0: none.
    relief : bool
        Whether the height map is shaded.
    exaggeration : float
        Scale of depth relative to width in 3D.
    light : Light
        The lamp.
    colour_by : str
        Quantity shown by the colours in 3D: one of QUANTITIES.
    """

    colours: str = "viridis"
    range_mm: tuple[float, float] | None = None
    contour_mm: float = 0.0
    relief: bool = True
    exaggeration: float = 1.0
    light: Light = field(default_factory=Light)
    colour_by: str = "depth"


def display_as_text(display: Display) -> str:
    """Return the display settings as text for the settings file."""
    return json.dumps(asdict(display))


def display_from_text(text: str) -> Display:
    """Return the display settings of a text. Missing or invalid values get their defaults."""
    try:
        kept = json.loads(text)
        span, light = kept["range_mm"], kept["light"]
        display = Display(
            colours=str(kept["colours"]),
            range_mm=None if span is None else (float(span[0]), float(span[1])),
            contour_mm=float(kept["contour_mm"]),
            relief=bool(kept["relief"]),
            exaggeration=float(kept["exaggeration"]),
            light=Light(float(light["azimuth_deg"]), float(light["height_deg"])),
            colour_by=str(kept.get("colour_by", "depth")),
        )
    except (ValueError, KeyError, TypeError, IndexError):
        return Display()
    known = display.colours in COLOUR_MAPS and display.colour_by in QUANTITIES
    return display if known and _is_finite(display) else Display()


def _is_finite(display: Display) -> bool:
    light = display.light
    numbers = (display.contour_mm, display.exaggeration, light.azimuth_deg, light.height_deg)
    return all(math.isfinite(number) for number in (*numbers, *(display.range_mm or ())))


@lru_cache(maxsize=16)
def colour_table(name: str) -> NDArray[np.uint8]:
    """Return a colour map as (256, 3) uint8, RGB."""
    table = pg.colormap.get(name).getLookupTable(nPts=256, mode="byte", alpha=False)
    return np.ascontiguousarray(table[:, :3], np.uint8)
