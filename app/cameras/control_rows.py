"""One row for each setting of a camera: the automatic switch and the value."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from PySide6.QtCore import QSignalBlocker, Signal
from PySide6.QtWidgets import (
    QCheckBox,
    QComboBox,
    QFormLayout,
    QHBoxLayout,
    QWidget,
)

from app.sources.source import Setting
from app.widgets.inputs import ComboBox, NumberField
from app.widgets.label import plain_tip
from app.widgets.naming import named
from gelpolight_core.session.camera_controls import CONTROLS

MAINS_HZ = (0.0, 50.0, 60.0)


class ControlRows(QWidget):
    """The settings of a camera, in the order in which they are applied.

    Signals
    -------
    changed(str, float)
        The user chose a value for a setting.
    """

    changed = Signal(str, float)

    def __init__(self) -> None:
        super().__init__()
        named(self, "camera.controls", "Camera settings")
        self._form = QFormLayout(self)
        self._form.setContentsMargins(0, 0, 0, 0)
        self._keys: tuple[str, ...] = ()
        self._show: dict[str, Callable[[Setting], None]] = {}

    def show_controls(self, controls: Sequence[Setting]) -> None:
        """Show the settings that a camera reports; a field in use by the user is not changed."""
        keys = tuple(control.key for control in controls)
        if keys != self._keys:
            self._keys = keys
            self._build(controls)
        for control in controls:
            self._show[control.key](control)

    def _build(self, controls: Sequence[Setting]) -> None:
        while self._form.rowCount():
            self._form.removeRow(0)
        self._show.clear()
        there = {control.key: control for control in controls}
        switches = {CONTROLS[key].automatic for key in there} & set(there)
        for key, control in there.items():
            if key in switches:
                continue
            row = QHBoxLayout()
            row.addWidget(self._field(control), 1)
            automatic = CONTROLS[key].automatic
            if automatic in there:
                row.addWidget(self._switch(automatic, there[automatic].label, "Automatic"))
            label = "" if CONTROLS[key].switch else control.label
            self._form.addRow(label, row)

    def _field(self, control: Setting) -> QWidget:
        if CONTROLS[control.key].switch:
            return self._switch(control.key, control.label, control.label)
        if control.key == "power_line_hz":
            return self._mains(control)
        return self._number(control)

    def _switch(self, key: str, accessible: str, text: str) -> QCheckBox:
        box = named(QCheckBox(text), f"camera.{key}", accessible)
        box.clicked.connect(lambda on: self.changed.emit(key, float(on)))

        def show(control: Setting) -> None:
            box.setChecked(bool(control.value))
            box.setEnabled(control.writable)

        self._show[key] = show
        return box

    def _mains(self, control: Setting) -> QComboBox:
        box = named(ComboBox(), "camera.power_line_hz", control.label)
        for hz in MAINS_HZ:
            box.addItem(f"{hz:g} Hz" if hz else "Off", hz)
        box.activated.connect(lambda _: self.changed.emit("power_line_hz", box.currentData()))
        self._show["power_line_hz"] = lambda c: box.setCurrentIndex(
            MAINS_HZ.index(c.value) if c.value in MAINS_HZ else 0
        )
        return box

    def _number(self, control: Setting) -> NumberField:
        step = control.step or 0.1
        box = NumberField(decimals=0 if step == round(step) else 1)
        named(box, f"camera.{control.key}", control.label)
        box.setSingleStep(step)
        box.setRange(control.low, control.high)
        box.setSuffix(f" {control.unit}" if control.unit else "")
        tip = f"From {control.low:g} to {control.high:g} {control.unit}"
        box.setToolTip(plain_tip(tip.rstrip()))
        box.valueChanged.connect(lambda value: self.changed.emit(control.key, value))

        def show(now: Setting) -> None:
            box.setEnabled(now.writable)
            with QSignalBlocker(box):
                box.setValue(now.value)

        self._show[control.key] = show
        return box
