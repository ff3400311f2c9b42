"""The preferences. Changes apply at once."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from PySide6.QtWidgets import QWidget

from app.services.preferences import Limits, Preferences
from app.widgets.dialog import Dialog
from app.widgets.forms import Form


class PreferencesDialog(Dialog):
    """Shows preferences and limits, and passes on their changes.

    Parameters
    ----------
    preferences, limits : Preferences, Limits
        As they are.
    keep, keep_limits : callable
        Get the name of each change, and the value.
    """

    def __init__(
        self,
        preferences: Preferences,
        keep: Callable[[str, Any], object],
        limits: Limits,
        keep_limits: Callable[[str, Any], object],
        parent: QWidget,
    ) -> None:
        super().__init__(parent, "preferences", "Preferences", once=True)
        self.setMinimumWidth(520)
        self.preferences = Form(preferences, "preferences")
        self.limits = Form(limits, "preferences")
        self.preferences.changed.connect(keep)
        self.limits.changed.connect(keep_limits)
        self.fill(self.preferences, self.limits)
