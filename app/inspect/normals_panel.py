"""The surface normals or the slope."""

from __future__ import annotations

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QWidget

from app.live.frame_results import Shown
from app.view2d.map_view import MapView, extent_of
from app.view2d.quantities import STEEPEST_DEG
from app.widgets.inputs import ComboBox
from app.widgets.layout import vbox
from app.widgets.naming import named
from gelpolight_core.translation import tr


class NormalsPanel(QWidget):
    """Shows the normals as colours, or the slope.

    Signals
    -------
    chosen()
        The other quantity was selected.
    """

    chosen = Signal()

    def __init__(self) -> None:
        super().__init__()
        named(self, "inspect.normals", tr("Normals"))
        self.map = MapView("inspect.normals.map", tr("Normals"))
        self._what = named(ComboBox(), "inspect.normals.what", tr("Quantity shown"))
        self._what.addItem(tr("Normals: x in red, y in green"), "normals")
        self._what.addItem(tr("Slope"), "slope")
        self._what.currentIndexChanged.connect(self._on_chosen)
        vbox(self._what, (self.map, 1), of=self, margins=0, spacing=2)
        self.map.say(tr("No depth yet."))

    @property
    def what(self) -> str:
        """The shown quantity: ``normals`` or ``slope``."""
        return str(self._what.currentData())

    def show_frame(self, shown: Shown) -> None:
        """Show a frame."""
        if shown.normals is not None and shown.heightmap is not None:
            self.map.set_image(shown.normals, extent_of(shown.heightmap))
            if self.what == "slope":
                self.map.show_colours("magma", 0.0, STEEPEST_DEG, "°")

    def _on_chosen(self) -> None:
        # The colours of one quantity are meaningless for the other.
        if self.map.has_image:
            self.map.say(tr("Please wait."))
        self.chosen.emit()
