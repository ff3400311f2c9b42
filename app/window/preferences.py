"""The dialog of the preferences and of the limits for warnings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

from PySide6.QtWidgets import QWidget

from app.program.context import AppContext
from app.widgets.dialog import Dialog
from app.widgets.forms import Form


class PreferencesDialog(Dialog):
    """Preferences and limits for warnings. Each change takes effect at once.

    Parameters
    ----------
    parent : QWidget
        The window.
    set_theme : callable
        Applies a theme and remembers it.
    context : AppContext
        Holds the settings.
    """

    def __init__(
        self, parent: QWidget, set_theme: Callable[[str], None], *, context: AppContext
    ) -> None:
        super().__init__(parent, "preferences", "Preferences", once=True)
        self._set_theme, self._context = set_theme, context
        settings = context.settings
        values = replace(settings.preferences, workspace=str(settings.workspace_folder))
        preferences, limits = Form(values, "preferences"), Form(settings.limits, "preferences")
        preferences.changed.connect(self._prefer)
        limits.changed.connect(self._limit)
        self.setMinimumWidth(520)
        self.fill(preferences, limits)

    def _prefer(self, name: str, value: str | float) -> None:
        settings, requests = self._context.settings, self._context.requests
        settings.prefer(**{name: value})
        match name:
            case "theme":
                self._set_theme(str(value))
            case "workspace":
                self._context.workspace.folder = settings.workspace_folder
                requests.calibrations_changed.emit()
            case "reconstruction":
                requests.preferences_changed.emit()

    def _limit(self, name: str, value: float) -> None:
        settings = self._context.settings
        settings.limits = replace(settings.limits, **{name: value})
        self._context.requests.calibrations_changed.emit()
        self._context.requests.preferences_changed.emit()
