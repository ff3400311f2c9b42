"""Inputs that ignore the mouse wheel until they have the focus.

Over an input without focus the wheel scrolls the panel around it, as if the input were not there.
"""

from __future__ import annotations

from typing import Any

from PySide6.QtCore import Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtWidgets import QComboBox, QDoubleSpinBox, QSlider, QSpinBox


class _WheelNeedsFocus:
    """Mixin in front of a Qt input."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)  # type: ignore[attr-defined]

    def wheelEvent(self, event: QWheelEvent) -> None:
        """Change the value if the input has the focus, else leave the event to the panel."""
        if self.hasFocus():  # type: ignore[attr-defined]
            super().wheelEvent(event)  # type: ignore[misc]
        else:
            event.ignore()


class SpinBox(_WheelNeedsFocus, QSpinBox):
    """A spin box of whole numbers."""


class DoubleSpinBox(_WheelNeedsFocus, QDoubleSpinBox):
    """A spin box of decimal numbers."""


class ComboBox(_WheelNeedsFocus, QComboBox):
    """A drop-down list."""


class Slider(_WheelNeedsFocus, QSlider):
    """A slider."""
