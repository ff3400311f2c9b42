"""The preferences. Changes apply at once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from PySide6.QtWidgets import QDialog, QDialogButtonBox, QVBoxLayout, QWidget

from app.services.preferences import Limits, Preferences
from app.widgets.forms import Form
from app.widgets.naming import named
from gelpolight_core.translation import tr


class PreferencesDialog(QDialog):
    """Shows preferences and limits, and passes on their changes.

    Parameters
    ----------
    preferences, limits : Preferences, Limits
        As they are.
    keep, keep_limits : callable
        Get the name of each change, and the value.
    """

    def __init__(
        self, preferences: Preferences, keep: Callable[[str, Any], object], limits: Limits,
        keep_limits: Callable[[str, Any], object], parent: QWidget,
    ) -> None:  # fmt: skip
        super().__init__(parent)
        named(self, "preferences", tr("Preferences"))
        self.setWindowTitle(tr("Preferences"))
        self.setMinimumWidth(520)
        self.preferences = Form(preferences, "preferences")
        self.limits = Form(limits, "preferences")
        self.preferences.changed.connect(keep)
        self.limits.changed.connect(keep_limits)
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close)
        buttons.rejected.connect(self.reject)
        column = QVBoxLayout(self)
        for part in (self.preferences, self.limits, buttons):
            column.addWidget(part)
