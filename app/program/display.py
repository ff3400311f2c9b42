"""Display settings of depth: one store for Inspect, Measure, the wizard and the reports."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from PySide6.QtCore import QObject, Signal

from gelpolight_core.base.form_fields import (
    choice,
    from_settings_text,
    number,
    switch,
    to_settings_text,
)

from .settings import AppSettings

LIMITS_MM = -1.0, 5.0
"""Limits of a colour range that the user sets."""
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
    "uncertainty": "Uncertainty (when frozen)",
    "flags": "Flags",
    "difference": "Difference from the reference",
}
"""Quantities that can colour the 3D surface."""
KEEP_RANGE = "Keep the colour range. If unlocked, it follows the deepest press"
KEY = "display"
EARLIER_KEYS = "view3d", "look"
"""Keys of earlier settings files, which held the 3D view and the rest separately."""


@dataclass(frozen=True, slots=True)
class DisplaySettings:
    """Display settings that all views of the depth share.

    Attributes
    ----------
    colours : str
        One of COLOUR_MAPS.
    colour_by : str
        Quantity shown by the colours in 3D on the Inspect page: one of QUANTITIES.
    locked : bool
        Whether the colours have the range from `low_mm` to `high_mm`, not the automatic one.
    low_mm, high_mm : float
        Depths at the ends of a locked range.
    contour_mm : float
        Depth between contour lines. 0: none.
    relief : bool
        Whether the height map is shaded.
    exaggeration : float
        Scale of depth relative to width in 3D. Ticks and picked values stay true.
    azimuth_deg, elevation_deg : float
        Direction of the lamp that shades the relief: from the upper edge of the image, clockwise
        (315 is the upper left), and above the surface.
    axes, colour_bar, orientation, scale_bar, wireframe : bool
        Whether the 3D view draws them.
    parallel : bool
        Parallel instead of perspective projection in 3D.
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
    axes: bool = switch(True, "", "Axes in mm")
    colour_bar: bool = switch(True, "", "Colour bar")
    orientation: bool = switch(True, "", "Orientation widget")
    scale_bar: bool = switch(False, "", "Scale bar")
    wireframe: bool = switch(False, "", "Wireframe")
    parallel: bool = switch(False, "", "Parallel projection")

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


IN_3D = "axes", "colour_bar", "orientation", "scale_bar", "wireframe", "parallel"
"""Settings in the menu of the 3D view; the others are in the panel of the Inspect page."""


class DisplayStore(QObject):
    """Holds the display settings, and keeps them in the settings file.

    Parameters
    ----------
    settings : AppSettings
        The file.

    Attributes
    ----------
    value : DisplaySettings
        The present settings.

    Signals
    -------
    changed()
        A setting has changed.
    """

    changed = Signal()

    def __init__(self, settings: AppSettings) -> None:
        super().__init__()
        self._settings = settings
        texts = (settings.display(key) for key in (*EARLIER_KEYS, KEY))
        self.value = from_settings_text(DisplaySettings, *texts)

    def change(self, **values: Any) -> None:
        """Change some settings."""
        value = replace(self.value, **values)
        if value != self.value:
            self.value = value
            self._settings.keep_display(KEY, to_settings_text(value))
            self.changed.emit()
