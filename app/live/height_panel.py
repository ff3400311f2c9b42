"""The height map with its colour bar."""

from __future__ import annotations

from PySide6.QtCore import QElapsedTimer
from PySide6.QtWidgets import QWidget

from app.program.display import LIMITS_MM
from app.views.map.colour_bar import depth_counts
from app.views.map.map_view import MapView, extent_of
from app.widgets.layout import vbox
from app.widgets.widget_names import set_names
from gelpolight_core.base.compared_quantity import readable_unit

from .frame_processor import FrameResult
from .tool_layer import ToolLayer, ToolLayerOwner

HISTOGRAM_MS = 200
"""Minimum time between two histograms of a live map, so that they can be read."""


class HeightPanel(QWidget):
    """Shows the height map, its colour bar, how often each depth occurs, and tools on the map.

    Parameters
    ----------
    user : ToolLayerOwner
        Called when the tools are clicked or dragged.
    adjustable : bool, optional
        Whether the ends of the colour range can be dragged.
    """

    def __init__(self, user: ToolLayerOwner, *, adjustable: bool = False) -> None:
        super().__init__()
        set_names(self, "inspect.height", "Height map")
        limits = LIMITS_MM if adjustable else None
        self.map = MapView("inspect.height.map", "Height map", limits=limits)
        self.layer = ToolLayer(user)
        self.map.box.addItem(self.layer, ignoreBounds=True)
        self._since_histogram = QElapsedTimer()
        self.column = vbox((self.map, 1), of=self, margins=0, spacing=0)
        self.map.show_message("No depth yet.")
        if adjustable:
            self.map.bar.setToolTip(
                "Drag a handle to set and lock the colour range. Double-click: automatic range."
            )

    def show_frame(self, result: FrameResult, *, still: bool) -> None:
        """Show a frame's height map. The histogram is updated a few times per second."""
        if result.height is None or result.heightmap is None:
            return
        self.map.set_image(result.height, extent_of(result.heightmap))
        unit, factor = readable_unit(*result.range_mm)
        self.map.show_colours(result.colours, *result.range_mm, unit, factor=factor)
        since = self._since_histogram
        if still or not since.isValid() or since.elapsed() >= HISTOGRAM_MS:
            since.start()
            self.map.bar.show_histogram(depth_counts(result.heightmap, result.range_mm))

    def show_message(self, text: str) -> None:
        """Show a text instead of the map."""
        self.map.show_message(text)
