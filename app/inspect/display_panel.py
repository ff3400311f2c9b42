"""Panel for colours, range, contour lines and the lamp."""

from __future__ import annotations

from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QDoubleSpinBox,
    QFormLayout,
    QHBoxLayout,
    QSlider,
    QWidget,
)

from app.view2d.display import LIMITS_MM, Display, Light, colour_map_labels
from app.view2d.quantities import quantity_names
from app.widgets.inputs import ComboBox, Dial, DoubleSpinBox, Slider
from app.widgets.naming import named
from gelpolight_core.translation import tr


class DisplayPanel(QWidget):
    """Lets the user choose the display settings of depth.

    Signals
    -------
    changed()
        The display settings changed.
    """

    changed = Signal()

    def __init__(self) -> None:
        super().__init__()
        named(self, "inspect.display", tr("Display"))
        form = QFormLayout(self)
        form.setFieldGrowthPolicy(QFormLayout.FieldGrowthPolicy.AllNonFixedFieldsGrow)
        self._colours = named(ComboBox(), "inspect.display.colours", tr("Colours"))
        for key, name in colour_map_labels().items():
            self._colours.addItem(name, key)
        self._colour_by = named(
            ComboBox(), "inspect.display.colour_by", tr("Colour the surface by")
        )
        for key, name in quantity_names().items():
            self._colour_by.addItem(name, key)
        self._lock = named(
            QCheckBox(tr("Lock")), "inspect.display.lock", tr("Lock the range"),
            tr("Keep the colour range. If unlocked, it follows the deepest press"), "K",
        )  # fmt: skip
        self._low = self._depth("low", tr("Depth at the low end of the colours"), LIMITS_MM[0])
        self._high = self._depth("high", tr("Depth at the high end of the colours"), 0.01)
        self._contour = self._depth("contour", tr("Depth between contour lines"), 0.0)
        self._contour.setSpecialValueText(tr("none"))
        self._contour.setSingleStep(0.05)
        self._relief = named(
            QCheckBox(tr("Shade the height map")),
            "inspect.display.relief",
            tr("Shade the height map"),
        )
        self._stretch = self._slider("exaggeration", tr("Depth scale in 3D"), 10, 80)
        self._azimuth = named(
            Dial(), "inspect.display.azimuth", tr("Light direction"), tr("Direction of the light")
        )
        self._azimuth.setRange(0, 359)
        self._azimuth.setWrapping(True)
        self._azimuth.setFixedSize(56, 56)
        self._height = self._slider("light_height", tr("Elevation of the light"), 15, 85)
        span = QHBoxLayout()
        span.addWidget(self._low)
        span.addWidget(self._high)
        lamp = QHBoxLayout()
        lamp.addWidget(self._azimuth)
        lamp.addWidget(self._height, 1)
        form.addRow(tr("Colours"), self._colours)
        form.addRow(tr("3D shows"), self._colour_by)
        form.addRow(tr("Range"), self._lock)
        form.addRow("", span)
        form.addRow(tr("Contours"), self._contour)
        form.addRow("", self._relief)
        form.addRow(tr("Stretch"), self._stretch)
        form.addRow(tr("Light"), lamp)
        self._high.setValue(1.0)
        self.show_display(Display())
        self._connect()

    def _depth(self, name: str, accessible: str, low: float) -> QDoubleSpinBox:
        box = named(DoubleSpinBox(), f"inspect.display.{name}", accessible)
        box.setRange(low, LIMITS_MM[1])
        box.setDecimals(2)
        box.setSingleStep(0.1)
        box.setSuffix(tr(" mm"))
        box.setKeyboardTracking(False)
        return box

    def _slider(self, name: str, accessible: str, low: int, high: int) -> QSlider:
        slider = named(Slider(Qt.Orientation.Horizontal), f"inspect.display.{name}", accessible)
        slider.setRange(low, high)
        return slider

    def _connect(self) -> None:
        self._colours.currentIndexChanged.connect(self.changed)
        self._colour_by.currentIndexChanged.connect(self.changed)
        self._lock.toggled.connect(self._on_lock)
        for box in (self._low, self._high, self._contour):
            box.valueChanged.connect(self.changed)
        self._relief.toggled.connect(self.changed)
        for slider in (self._stretch, self._azimuth, self._height):
            slider.valueChanged.connect(self.changed)

    @property
    def display(self) -> Display:
        """The display settings."""
        low, high = self._low.value(), self._high.value()
        return Display(
            colours=str(self._colours.currentData()),
            range_mm=(low, max(high, low + 0.01)) if self._lock.isChecked() else None,
            contour_mm=self._contour.value(),
            relief=self._relief.isChecked(),
            exaggeration=0.1 * self._stretch.value(),
            light=Light(float((self._azimuth.value() + 180) % 360), float(self._height.value())),
            colour_by=str(self._colour_by.currentData()),
        )

    def colour_by(self, quantity: str) -> None:
        """Colour the surface in 3D by one of QUANTITIES."""
        self._colour_by.setCurrentIndex(max(self._colour_by.findData(quantity), 0))

    def show_display(self, display: Display) -> None:
        """Show display settings without emitting a signal."""
        widgets = (
            self._colours, self._lock, self._low, self._high, self._contour, self._relief,
            self._stretch, self._azimuth, self._height, self._colour_by,
        )  # fmt: skip
        blockers = [QSignalBlocker(widget) for widget in widgets]
        self._colours.setCurrentIndex(max(self._colours.findData(display.colours), 0))
        self.colour_by(display.colour_by)
        self._lock.setChecked(display.range_mm is not None)
        if display.range_mm is not None:
            self._low.setValue(display.range_mm[0])
            self._high.setValue(display.range_mm[1])
        self._contour.setValue(display.contour_mm)
        self._relief.setChecked(display.relief)
        self._stretch.setValue(round(10.0 * display.exaggeration))
        # A dial has its zero at the bottom.
        self._azimuth.setValue(int(display.light.azimuth_deg + 180.0) % 360)
        self._height.setValue(round(display.light.height_deg))
        for blocker in blockers:
            blocker.unblock()
        self._enable_range()

    def show_range(self, low: float, high: float) -> None:
        """Show the range of a frame, unless the range is locked."""
        if self._lock.isChecked() or self._low.hasFocus() or self._high.hasFocus():
            return
        for box, value in ((self._low, low), (self._high, high)):
            if abs(box.value() - value) >= 0.01:
                with QSignalBlocker(box):
                    box.setValue(value)

    def toggle_lock(self) -> None:
        """Lock the current range, or make it automatic."""
        self._lock.toggle()

    def lock_range(self, low: float, high: float) -> None:
        """Lock the range at these depths, mm."""
        blockers = [QSignalBlocker(widget) for widget in (self._lock, self._low, self._high)]
        self._lock.setChecked(True)
        self._low.setValue(low)
        self._high.setValue(high)
        for blocker in blockers:
            blocker.unblock()
        self._on_lock()

    def unlock_range(self) -> None:
        """Make the range automatic."""
        self._lock.setChecked(False)

    def _on_lock(self) -> None:
        self._enable_range()
        self.changed.emit()

    def _enable_range(self) -> None:
        for box in (self._low, self._high):
            box.setEnabled(self._lock.isChecked())
