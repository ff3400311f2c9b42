"""Which way the surface faces, or how steep it is."""

from __future__ import annotations

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QComboBox, QHBoxLayout, QVBoxLayout, QWidget

from app.inspect.colour_bar import ColourBar
from app.inspect.height_panel import extent_of
from app.inspect.map_view import MapView
from app.inspect.products import STEEPNESS, Shown
from app.widgets.naming import named
from gelpolight_core.translation import tr


class NormalsPanel(QWidget):
    """Shows the normals as colours, or the slope.

    Signals
    -------
    chosen()
        The other one is to be shown.
    """

    chosen = Signal()

    def __init__(self) -> None:
        super().__init__()
        named(self, "inspect.normals", tr("Normals"))
        self.map = MapView("inspect.normals.map", tr("Normals"))
        self.bar = ColourBar("inspect.normals.bar", tr("Colours of the slope"))
        self.bar.show_range("magma", *STEEPNESS[1:], "°")
        self.bar.hide()
        self._what = named(QComboBox(), "inspect.normals.what", tr("What is shown"))
        self._what.addItem(tr("Normals: x in red, y in green"), "normals")
        self._what.addItem(tr("Slope"), "slope")
        self._what.currentIndexChanged.connect(self._on_chosen)
        row = QHBoxLayout()
        row.setSpacing(0)
        row.addWidget(self.map, 1)
        row.addWidget(self.bar)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(2)
        column.addWidget(self._what)
        column.addLayout(row, 1)
        self.map.say(tr("No depth yet."))

    @property
    def what(self) -> str:
        """What is shown: ``normals`` or ``slope``."""
        return str(self._what.currentData())

    def show_frame(self, shown: Shown) -> None:
        """Show a frame."""
        if shown.normals is not None and shown.heightmap is not None:
            self.map.show_picture(shown.normals, extent_of(shown.heightmap))

    def _on_chosen(self) -> None:
        self.bar.setVisible(self.what == "slope")
        self.chosen.emit()
