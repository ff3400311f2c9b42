"""Dialog for the maximum errors to pass."""

from __future__ import annotations

from PySide6.QtWidgets import QDialog, QDialogButtonBox, QVBoxLayout, QWidget

from app.services.preferences import Limits
from app.widgets.forms import Form
from app.widgets.label import PlainLabel
from app.widgets.naming import named
from gelpolight_core.translation import tr


class LimitsDialog(QDialog):
    """Asks for the limits. A button restores those of the paper."""

    def __init__(self, limits: Limits, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        named(self, "measure.limits", tr("Error limits"))
        self.setWindowTitle(tr("Error limits"))
        words = PlainLabel(
            tr(
                "A measurement passes if its errors are within these limits. The paper "
                "reports 5 % in the plane and 8 % in depth for its own sensor."
            )
        )
        words.setWordWrap(True)
        self.form = Form(limits, "measure.limits")
        self.form.rows.setRowVisible(self.form.inputs["age_days"], False)
        kinds = QDialogButtonBox.StandardButton
        buttons = QDialogButtonBox(kinds.Ok | kinds.Cancel | kinds.RestoreDefaults)
        buttons.accepted.connect(self.accept)
        buttons.rejected.connect(self.reject)
        restore = buttons.button(kinds.RestoreDefaults)
        restore.setText(tr("Paper values"))
        restore.clicked.connect(lambda: self.form.show_value(Limits(age_days=limits.age_days)))
        column = QVBoxLayout(self)
        for part in (words, self.form, buttons):
            column.addWidget(part)
