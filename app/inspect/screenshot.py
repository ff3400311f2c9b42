"""Asks what to picture, and how large."""

from __future__ import annotations

from PySide6.QtCore import Qt, Signal
from PySide6.QtWidgets import (
    QComboBox,
    QDialog,
    QDialogButtonBox,
    QFormLayout,
    QHBoxLayout,
    QSpinBox,
    QVBoxLayout,
    QWidget,
)

from app.widgets.naming import named
from gelpolight_core.translation import tr

LARGEST_PX = 8000


class ScreenshotDialog(QDialog):
    """Lets a person choose the surface in any size, or all views as they are.

    Signals
    -------
    chosen(str, int, int)
        ``surface`` or ``views``, width, height.
    """

    chosen = Signal(str, int, int)

    def __init__(self, width: int, height: int, has_surface: bool, *, parent: QWidget) -> None:
        super().__init__(parent)
        named(self, "inspect.screenshot.dialog", tr("Screenshot"))
        self.setWindowTitle(tr("Screenshot"))
        self.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        self._what = named(QComboBox(), "inspect.screenshot.what", tr("What is pictured"))
        if has_surface:
            self._what.addItem(tr("The surface in 3D"), "surface")
        self._what.addItem(tr("All views, as they are"), "views")
        self._width, self._height = QSpinBox(), QSpinBox()
        named(self._width, "inspect.screenshot.width", tr("Width"))
        named(self._height, "inspect.screenshot.height", tr("Height"))
        for box, value in ((self._width, 2 * width), (self._height, 2 * height)):
            box.setRange(64, LARGEST_PX)
            box.setValue(value)
            box.setSuffix(tr(" px"))
        self._what.currentIndexChanged.connect(self._follow)
        size = QHBoxLayout()
        size.addWidget(self._width)
        size.addWidget(self._height)
        form = QFormLayout()
        form.addRow(tr("Picture of"), self._what)
        form.addRow(tr("Size"), size)
        buttons = QDialogButtonBox(
            QDialogButtonBox.StandardButton.Save | QDialogButtonBox.StandardButton.Cancel
        )
        buttons.accepted.connect(self._accept)
        buttons.rejected.connect(self.reject)
        column = QVBoxLayout(self)
        column.addLayout(form)
        column.addWidget(buttons)
        self._follow()

    def _follow(self) -> None:
        sized = self._what.currentData() == "surface"
        self._width.setEnabled(sized)
        self._height.setEnabled(sized)

    def _accept(self) -> None:
        self.chosen.emit(self._what.currentData(), self._width.value(), self._height.value())
        self.accept()
