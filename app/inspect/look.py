"""How depth is shown: colours, range, light, contour lines."""

from __future__ import annotations

import json
import math
from dataclasses import asdict, dataclass, field
from functools import lru_cache

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray

from gelpolight_core.translation import tr

# Perceptually even, so that equal steps of depth look equal: name in pyqtgraph -> what people read.
COLOUR_MAPS = {
    "viridis": tr("Viridis"),
    "cividis": tr("Cividis (colour-blind safe)"),
    "inferno": tr("Inferno"),
    "magma": tr("Magma"),
    "CET-L1": tr("Grey"),
    "plasma": tr("Plasma"),
}
LEAST_RANGE_MM = 0.02


@dataclass(frozen=True, slots=True)
class Light:
    """Where the lamp stands that shades the relief.

    Attributes
    ----------
    azimuth_deg : float
        From the upper edge of the picture, clockwise; 315 is the upper left.
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
class Look:
    """What all views of the depth have in common.

    Attributes
    ----------
    colours : str
        A key of COLOUR_MAPS.
    range_mm : (low, high) or None
        Depths at the ends of the colours; None: each frame's own.
    contour_mm : float
        Depth between contour lines; 0: none.
    relief : bool
        Whether the height map is shaded.
    exaggeration : float
        Of depth against width in 3D.
    light : Light
        The lamp.
    """

    colours: str = "viridis"
    range_mm: tuple[float, float] | None = None
    contour_mm: float = 0.0
    relief: bool = True
    exaggeration: float = 1.0
    light: Light = field(default_factory=Light)


def look_as_text(look: Look) -> str:
    """Return a look as text for the settings."""
    return json.dumps(asdict(look))


def look_from_text(text: str) -> Look:
    """Return the look that a text describes; what it does not say, or says wrongly, is as usual."""
    try:
        kept = json.loads(text)
        span, light = kept["range_mm"], kept["light"]
        look = Look(
            colours=str(kept["colours"]),
            range_mm=None if span is None else (float(span[0]), float(span[1])),
            contour_mm=float(kept["contour_mm"]),
            relief=bool(kept["relief"]),
            exaggeration=float(kept["exaggeration"]),
            light=Light(float(light["azimuth_deg"]), float(light["height_deg"])),
        )
    except (ValueError, KeyError, TypeError, IndexError):
        return Look()
    return look if look.colours in COLOUR_MAPS and _is_finite(look) else Look()


def _is_finite(look: Look) -> bool:
    light = look.light
    numbers = (look.contour_mm, look.exaggeration, light.azimuth_deg, light.height_deg)
    return all(math.isfinite(number) for number in (*numbers, *(look.range_mm or ())))


@lru_cache(maxsize=16)
def colour_table(name: str) -> NDArray[np.uint8]:
    """Return a colour map as (256, 3) uint8, RGB."""
    table = pg.colormap.get(name).getLookupTable(nPts=256, mode="byte", alpha=False)
    return np.ascontiguousarray(table[:, :3], np.uint8)
