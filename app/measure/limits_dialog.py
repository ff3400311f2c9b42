"""Dialog for the maximum errors to pass."""

from __future__ import annotations

from PySide6.QtWidgets import QWidget

from app.services.preferences import Limits
from app.widgets.dialog import Dialog, Kinds
from app.widgets.forms import Form
from app.widgets.label import PlainLabel
from gelpolight_core.translation import tr


class LimitsDialog(Dialog):
    """Asks for the limits. A button restores those of the paper."""

    def __init__(self, limits: Limits, parent: QWidget | None = None) -> None:
        kinds = Kinds.Ok | Kinds.Cancel | Kinds.RestoreDefaults
        super().__init__(parent, "measure.limits", tr("Error limits"), kinds, once=True)
        text = tr(
            "A measurement passes if its errors are within these limits. The paper "
            "reports 5 % in the plane and 8 % in depth for its own sensor."
        )
        self.form = Form(limits, "measure.limits")
        self.form.rows.setRowVisible(self.form.inputs["age_days"], False)
        restore = self.buttons.button(Kinds.RestoreDefaults)
        restore.setText(tr("Paper values"))
        restore.clicked.connect(lambda: self.form.show_value(Limits(age_days=limits.age_days)))
        self.fill(PlainLabel(text, wrap=True), self.form)
