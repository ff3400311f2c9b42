"""The height map with what its colours mean."""

from __future__ import annotations

from PySide6.QtWidgets import QHBoxLayout, QWidget

from app.inspect.colour_bar import ColourBar
from app.inspect.map_view import MapView
from app.inspect.products import Shown
from app.widgets.naming import named
from gelpolight_core.reconstruction.heightmap import HeightMap
from gelpolight_core.translation import tr


class HeightPanel(QWidget):
    """Shows the height map."""

    def __init__(self) -> None:
        super().__init__()
        named(self, "inspect.height", tr("Height map"))
        self.map = MapView("inspect.height.map", tr("Height map"))
        self.bar = ColourBar("inspect.height.bar", tr("Colours of the depth"))
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        row.setSpacing(0)
        row.addWidget(self.map, 1)
        row.addWidget(self.bar)
        self.map.say(tr("No depth yet."))

    def show_frame(self, shown: Shown, colours: str) -> None:
        """Show a frame's height map."""
        if shown.height is not None and shown.heightmap is not None:
            self.map.show_picture(shown.height, extent_of(shown.heightmap))
            self.bar.show_range(colours, *shown.range_mm, tr("mm"))


def extent_of(heightmap: HeightMap) -> tuple[float, float, float, float]:
    """Return (left, top, right, bottom) of the outer edges of the grid's cells, mm."""
    half = 0.5 * heightmap.pitch_mm
    return (
        float(heightmap.x_mm[0]) - half,
        float(heightmap.y_mm[0]) - half,
        float(heightmap.x_mm[-1]) + half,
        float(heightmap.y_mm[-1]) + half,
    )
