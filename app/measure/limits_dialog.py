"""Dialog for the maximum errors to pass."""

from __future__ import annotations

from dataclasses import replace

from PySide6.QtWidgets import (
    QDialog,
    QDialogButtonBox,
    QDoubleSpinBox,
    QFormLayout,
    QVBoxLayout,
    QWidget,
)

from app.services.settings import Limits
from app.widgets.inputs import DoubleSpinBox
from app.widgets.label import PlainLabel
from app.widgets.naming import named
from gelpolight_core.translation import tr


class LimitsDialog(QDialog):
    """Asks for the two limits. A button restores those of the paper."""

    def __init__(self, limits: Limits, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        named(self, "measure.limits", tr("Error limits"))
        self.setWindowTitle(tr("Error limits"))
        self._limits = limits
        words = PlainLabel(
            tr(
                "A measurement passes if its errors are within these limits. The paper "
                "reports 5 % in the plane and 8 % in depth for its own sensor."
            )
        )
        words.setWordWrap(True)
        self.size = _percent("measure.limits.size", tr("Maximum error in the plane"))
        self.height = _percent("measure.limits.height", tr("Maximum error in depth"))
        self._show(limits)
        form = QFormLayout()
        form.addRow(tr("In the plane"), self.size)
        form.addRow(tr("In depth"), self.height)
        kinds = QDialogButtonBox.StandardButton
        buttons = QDialogButtonBox(kinds.Ok | kinds.Cancel | kinds.RestoreDefaults)
        buttons.accepted.connect(self.accept)
        buttons.rejected.connect(self.reject)
        restore = buttons.button(kinds.RestoreDefaults)
        restore.setText(tr("Paper values"))
        restore.clicked.connect(lambda: self._show(Limits()))
        column = QVBoxLayout(self)
        column.addWidget(words)
        column.addLayout(form)
        column.addWidget(buttons)

    @property
    def limits(self) -> Limits:
        """The limits as set."""
        return replace(
            self._limits, size_percent=self.size.value(), height_percent=self.height.value()
        )

    def _show(self, limits: Limits) -> None:
        self.size.setValue(limits.size_percent)
        self.height.setValue(limits.height_percent)


def _percent(name: str, accessible: str) -> QDoubleSpinBox:
    box = named(DoubleSpinBox(), name, accessible)
    box.setDecimals(1)
    box.setRange(0.1, 100.0)
    box.setSuffix(tr(" %"))
    return box
