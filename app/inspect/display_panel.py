"""Panel for colours, range, contour lines and the lamp."""

from __future__ import annotations

from dataclasses import replace

from PySide6.QtCore import Signal
from PySide6.QtWidgets import QWidget

from app.view2d.display import Display
from app.widgets.forms import Form
from app.widgets.layout import vbox
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
        self._range = 0.0, 1.0
        self._form = Form(Display(), "inspect.display")
        self._form.changed.connect(self._on_changed)
        vbox(self._form, None, of=self)

    @property
    def display(self) -> Display:
        """The display settings."""
        return self._form.value

    def colour_by(self, quantity: str) -> None:
        """Colour the surface in 3D by one of QUANTITIES."""
        self._form.change(colour_by=quantity)

    def show_display(self, display: Display) -> None:
        """Show display settings without emitting a signal."""
        self._form.show_value(display)

    def show_range(self, low: float, high: float) -> None:
        """Note the range of a frame, which is that of a lock."""
        self._range = low, high

    def toggle_lock(self) -> None:
        """Lock the current range, or make it automatic."""
        self._form.change(locked=not self.display.locked)

    def lock_range(self, low: float, high: float) -> None:
        """Lock the range at these depths, mm."""
        self._range = low, high
        self._form.change(locked=True)

    def unlock_range(self) -> None:
        """Make the range automatic."""
        self._form.change(locked=False)

    def _on_changed(self, name: str) -> None:
        if name == "locked" and self.display.locked:
            low, high = self._range
            self._form.show_value(replace(self.display, low_mm=low, high_mm=high))
        self.changed.emit()
