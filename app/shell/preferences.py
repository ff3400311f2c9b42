"""The preferences: theme, workspace folder, limits; they take effect at once."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import Signal
from PySide6.QtWidgets import (
    QComboBox,
    QDialog,
    QDialogButtonBox,
    QDoubleSpinBox,
    QFileDialog,
    QFormLayout,
    QHBoxLayout,
    QLineEdit,
    QPushButton,
    QWidget,
)

from app.shell.icons import icon
from app.shell.settings import Limits, Settings
from app.widgets.label import PlainLabel
from app.widgets.naming import named
from gelpolight_core.translation import tr

THEME_NAMES = {
    "system": tr("As the desktop"),
    "light": tr("Light"),
    "dark": tr("Dark"),
}


class PreferencesDialog(QDialog):
    """Shows the settings and changes them at once."""

    theme_changed = Signal(str)
    workspace_changed = Signal(str)
    limits_changed = Signal()

    def __init__(self, settings: Settings, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._settings = settings
        named(self, "preferences", tr("Preferences"))
        self.setWindowTitle(tr("Preferences"))
        self.setMinimumWidth(520)
        self._form = QFormLayout(self)
        self._build_theme()
        self._build_workspace()
        self._limits = {
            "age_days": self._number(
                "age_days", tr("Mark a calibration older than"), " d", 1.0, 3650.0, 0
            ),
            "height_percent": self._number(
                "height_percent", tr("Validation: largest error of a height"), " %", 0.1, 50.0, 1
            ),
            "size_percent": self._number(
                "size_percent", tr("Validation: largest error of a width"), " %", 0.1, 50.0, 1
            ),
        }
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close, self)
        buttons.rejected.connect(self.reject)
        self._form.addRow(buttons)

    def _build_theme(self) -> None:
        box = named(QComboBox(self), "preferences.theme", tr("Theme"))
        for key, label in THEME_NAMES.items():
            box.addItem(label, key)
        box.setCurrentIndex(box.findData(self._settings.theme))
        box.currentIndexChanged.connect(lambda _: self._set_theme(box.currentData()))
        self._form.addRow(tr("&Theme"), box)

    def _build_workspace(self) -> None:
        self._folder = named(
            QLineEdit(str(self._settings.workspace_folder), self),
            "preferences.workspace",
            tr("Workspace folder"),
            tr("Where sensors, calibrations and sessions are kept"),
        )
        self._folder.editingFinished.connect(lambda: self._set_workspace(self._folder.text()))
        choose = named(
            QPushButton(icon("folder"), "", self),
            "preferences.choose",
            tr("Choose the workspace folder"),
            tr("Choose a folder"),
        )
        choose.clicked.connect(self._choose_workspace)
        row = QHBoxLayout()
        row.addWidget(self._folder, 1)
        row.addWidget(choose)
        label = PlainLabel(tr("&Workspace folder"), self)
        label.setBuddy(self._folder)
        self._form.addRow(label, row)

    def _number(
        self, key: str, label: str, unit: str, low: float, high: float, decimals: int
    ) -> QDoubleSpinBox:
        box = named(QDoubleSpinBox(self), f"preferences.{key}", label)
        box.setDecimals(decimals)
        box.setRange(low, high)
        box.setSuffix(unit)
        box.setValue(getattr(self._settings.limits, key))
        box.valueChanged.connect(self._set_limits)
        self._form.addRow(label, box)
        return box

    def _set_theme(self, theme: str) -> None:
        self._settings.theme = theme
        self.theme_changed.emit(theme)

    def _choose_workspace(self) -> None:
        chosen = QFileDialog.getExistingDirectory(
            self, tr("Choose the workspace folder"), self._folder.text()
        )
        if chosen:
            self._folder.setText(chosen)
            self._set_workspace(chosen)

    def _set_workspace(self, text: str) -> None:
        folder = Path(text.strip()).expanduser()
        if not text.strip() or not folder.is_absolute():
            self._folder.setText(str(self._settings.workspace_folder))
        elif folder != self._settings.workspace_folder:
            self._settings.workspace_folder = folder
            self.workspace_changed.emit(str(folder))

    def _set_limits(self) -> None:
        self._settings.limits = Limits(**{k: box.value() for k, box in self._limits.items()})
        self.limits_changed.emit()
