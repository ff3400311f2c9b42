"""Colours, range, contour lines, and the lamp."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QDial,
    QDoubleSpinBox,
    QFormLayout,
    QHBoxLayout,
    QSlider,
    QWidget,
)

from app.inspect.look import COLOUR_MAPS, Light, Look
from app.widgets.naming import named
from gelpolight_core.translation import tr


class LookPanel(QWidget):
    """Lets a person choose how depth is shown.

    Signals
    -------
    changed()
        Another look was chosen.
    """

    changed = Signal()

    def __init__(self) -> None:
        super().__init__()
        named(self, "inspect.look", tr("Display"))
        form = QFormLayout(self)
        form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
        self._colours = named(QComboBox(), "inspect.look.colours", tr("Colours"))
        for key, name in COLOUR_MAPS.items():
            self._colours.addItem(name, key)
        self._lock = named(
            QCheckBox(tr("Lock")), "inspect.look.lock", tr("Lock the range"),
            tr("Keep the range of the colours; else each frame has its own (K)"),
        )  # fmt: skip
        self._low = self._depth("low", tr("Depth at the low end of the colours"), -1.0)
        self._high = self._depth("high", tr("Depth at the high end of the colours"), 0.01)
        self._contour = self._depth("contour", tr("Depth between contour lines"), 0.0)
        self._contour.setSpecialValueText(tr("none"))
        self._contour.setSingleStep(0.05)
        self._relief = named(
            QCheckBox(tr("Shade the height map")), "inspect.look.relief", tr("Shade the height map")
        )
        self._stretch = self._slider("exaggeration", tr("Depth stretched in 3D"), 10, 80)
        self._azimuth = named(
            QDial(), "inspect.look.azimuth", tr("Light from"), tr("Where the light comes from")
        )
        self._azimuth.setRange(0, 359)
        self._azimuth.setWrapping(True)
        self._azimuth.setFixedSize(56, 56)
        self._height = self._slider("light_height", tr("Height of the light"), 15, 85)
        span = QHBoxLayout()
        span.addWidget(self._low)
        span.addWidget(self._high)
        lamp = QHBoxLayout()
        lamp.addWidget(self._azimuth)
        lamp.addWidget(self._height, 1)
        form.addRow(tr("Colours"), self._colours)
        form.addRow(tr("Range"), self._lock)
        form.addRow("", span)
        form.addRow(tr("Contours"), self._contour)
        form.addRow("", self._relief)
        form.addRow(tr("Stretch"), self._stretch)
        form.addRow(tr("Light"), lamp)
        self._high.setValue(1.0)
        self.show_look(Look())
        self._connect()

    def _depth(self, name: str, accessible: str, low: float) -> QDoubleSpinBox:
        box = named(QDoubleSpinBox(), f"inspect.look.{name}", accessible)
        box.setRange(low, 5.0)
        box.setDecimals(2)
        box.setSingleStep(0.1)
        box.setSuffix(tr(" mm"))
        box.setKeyboardTracking(False)
        return box

    def _slider(self, name: str, accessible: str, low: int, high: int) -> QSlider:
        slider = named(QSlider(Qt.Orientation.Horizontal), f"inspect.look.{name}", accessible)
        slider.setRange(low, high)
        return slider

    def _connect(self) -> None:
        self._colours.currentIndexChanged.connect(self.changed)
        self._lock.toggled.connect(self._on_lock)
        for box in (self._low, self._high, self._contour):
            box.valueChanged.connect(self.changed)
        self._relief.toggled.connect(self.changed)
        for slider in (self._stretch, self._azimuth, self._height):
            slider.valueChanged.connect(self.changed)

    @property
    def look(self) -> Look:
        """How depth is shown."""
        low, high = self._low.value(), self._high.value()
        return Look(
            colours=str(self._colours.currentData()),
            range_mm=(low, max(high, low + 0.01)) if self._lock.isChecked() else None,
            contour_mm=self._contour.value(),
            relief=self._relief.isChecked(),
            exaggeration=0.1 * self._stretch.value(),
            light=Light(float((self._azimuth.value() + 180) % 360), float(self._height.value())),
        )

    def show_look(self, look: Look) -> None:
        """Show a look, without telling of it."""
        widgets = (
            self._colours, self._lock, self._low, self._high, self._contour, self._relief,
            self._stretch, self._azimuth, self._height,
        )  # fmt: skip
        blockers = [QSignalBlocker(widget) for widget in widgets]
        self._colours.setCurrentIndex(max(self._colours.findData(look.colours), 0))
        self._lock.setChecked(look.range_mm is not None)
        if look.range_mm is not None:
            self._low.setValue(look.range_mm[0])
            self._high.setValue(look.range_mm[1])
        self._contour.setValue(look.contour_mm)
        self._relief.setChecked(look.relief)
        self._stretch.setValue(round(10.0 * look.exaggeration))
        # A dial's zero is at its foot.
        self._azimuth.setValue(int(look.light.azimuth_deg + 180.0) % 360)
        self._height.setValue(round(look.light.height_deg))
        for blocker in blockers:
            blocker.unblock()
        self._enable_range()

    def show_range(self, low: float, high: float) -> None:
        """Show the range of a frame, while it is not locked."""
        if self._lock.isChecked() or self._low.hasFocus() or self._high.hasFocus():
            return
        for box, value in ((self._low, low), (self._high, high)):
            if abs(box.value() - value) >= 0.01:
                with QSignalBlocker(box):
                    box.setValue(value)

    def toggle_lock(self) -> None:
        """Lock the range as it is, or let it go."""
        self._lock.toggle()

    def _on_lock(self) -> None:
        self._enable_range()
        self.changed.emit()

    def _enable_range(self) -> None:
        for box in (self._low, self._high):
            box.setEnabled(self._lock.isChecked())
