"""The input of the ball's size in the side panel: a diameter, as a caliper measures it."""

from __future__ import annotations

from PySide6.QtWidgets import QHBoxLayout, QWidget

from app.widgets.inputs import DoubleSpinBox
from app.widgets.label import PlainLabel
from app.widgets.naming import named
from gelpolight_core.translation import tr


class RadiusRow(QWidget):
    """The diameter of the ball of the next press, or of the shown one.

    Files and calculations use the radius.
    """

    def __init__(self) -> None:
        super().__init__()
        row = QHBoxLayout(self)
        row.setContentsMargins(0, 0, 0, 0)
        self.box = named(
            DoubleSpinBox(),
            "calibrate.radius",
            tr("Diameter of the ball in mm"),
            tr("Diameter for the next press, or for the shown one"),
        )
        self.box.setRange(0.1, 1000.0)
        self.box.setDecimals(3)
        self.box.setSuffix(tr(" mm"))
        self.box.setKeyboardTracking(False)
        row.addWidget(PlainLabel(tr("Ball diameter")))
        row.addWidget(self.box, 1)

    @property
    def radius_mm(self) -> float:
        """Half of the diameter."""
        return 0.5 * self.box.value()

    @property
    def typing(self) -> bool:
        """Whether a diameter is being typed, so that the field still has the old value."""
        return self.box.valueFromText(self.box.text()) != self.box.value()

    def show_radius(self, radius_mm: float) -> None:
        """Show a radius without reporting it as an input."""
        self.box.blockSignals(True)
        self.box.setValue(2.0 * radius_mm)
        self.box.blockSignals(False)
