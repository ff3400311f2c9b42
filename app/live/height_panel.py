"""The height map with its colour bar."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QElapsedTimer, Signal
from PySide6.QtWidgets import QWidget

from app.live.frame_results import Shown
from app.view2d.colour_bar import depth_counts
from app.view2d.display import LIMITS_MM
from app.view2d.map_view import MapView, extent_of
from app.widgets.layout import hbox
from app.widgets.naming import named
from app.widgets.units import per_mm, unit_word
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.translation import tr

HISTOGRAM_MS = 200
"""Minimum time between two histograms of a live map, so that they can be read."""


class HeightPanel(QWidget):
    """Shows the height map, its colour bar, and how often each depth occurs.

    Parameters
    ----------
    adjustable : bool, optional
        Whether the ends of the colour range can be dragged.

    Signals
    -------
    range_dragged(float, float)
        The ends of the colour range were dragged to these depths, mm.
    range_released()
        The automatic colour range is wanted.
    """

    range_dragged = Signal(float, float)
    range_released = Signal()

    def __init__(self, *, adjustable: bool = False) -> None:
        super().__init__()
        named(self, "inspect.height", tr("Height map"))
        limits = LIMITS_MM if adjustable else None
        self.map = MapView("inspect.height.map", tr("Height map"), limits=limits)
        self._since_histogram = QElapsedTimer()
        hbox(self.map, of=self, margins=0)
        self.map.say(tr("No depth yet."))
        if adjustable:
            self.map.bar.setToolTip(
                tr("Drag a handle to set and lock the colour range. Double-click: automatic range.")
            )
            self.map.bar.range_dragged.connect(self.range_dragged)
            self.map.bar_double_clicked.connect(self.range_released)

    def show_frame(self, shown: Shown, colours: str, *, still: bool) -> None:
        """Show a frame's height map. The histogram is updated a few times per second."""
        if shown.height is None or shown.heightmap is None:
            return
        since = self._since_histogram
        due = still or not since.isValid() or since.elapsed() >= HISTOGRAM_MS
        self.show_image(shown.height, shown.heightmap, colours, shown.range_mm, histogram=due)

    def show_image(
        self,
        rgb: NDArray[np.uint8],
        heightmap: HeightMap,
        colours: str,
        range_mm: tuple[float, float],
        *,
        histogram: bool = True,
    ) -> None:
        """Show a height map as an image in these colours."""
        self.map.set_image(rgb, extent_of(heightmap))
        self.map.show_colours(colours, *range_mm, unit_word(), factor=per_mm())
        if histogram:
            self._since_histogram.start()
            self.map.bar.show_histogram(depth_counts(heightmap, range_mm))
