"""The preferences: theme, first page, mode, unit, folder, limits. Changes apply at once."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import Signal
from PySide6.QtWidgets import (
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

from app.services.settings import Limits, Settings
from app.theme.icons import icon
from app.widgets.inputs import ComboBox, DoubleSpinBox
from app.widgets.label import PlainLabel
from app.widgets.naming import named
from app.widgets.units import use_length_unit
from gelpolight_core.reconstruction.modes import MODES
from gelpolight_core.translation import LANGUAGES, current_language, system_language, tr

THEME_NAMES = {
    "system": tr("Same as the desktop"),
    "light": tr("Light"),
    "dark": tr("Dark"),
}


class PreferencesDialog(QDialog):
    """Shows the settings and applies changes at once."""

    theme_changed = Signal(str)
    workspace_changed = Signal(str)
    limits_changed = Signal()
    changed = Signal()
    """Another mode of the live depth, or unit of lengths."""

    def __init__(self, settings: Settings, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._settings = settings
        named(self, "preferences", tr("Preferences"))
        self.setWindowTitle(tr("Preferences"))
        self.setMinimumWidth(520)
        self._form = QFormLayout(self)
        self._build_theme()
        self._build_first_page()
        self._build_language()
        self._build_mode()
        self._build_unit()
        self._build_workspace()
        self._limits = {
            "age_days": self._number(
                "age_days", tr("Mark calibrations older than"), " d", 1.0, 3650.0, 0
            ),
            "height_percent": self._number(
                "height_percent", tr("Validation: maximum height error"), " %", 0.1, 50.0, 1
            ),
            "size_percent": self._number(
                "size_percent", tr("Validation: maximum width error"), " %", 0.1, 50.0, 1
            ),
        }
        self._build_recording()
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close, self)
        buttons.rejected.connect(self.reject)
        self._form.addRow(buttons)

    def _build_theme(self) -> None:
        box = named(ComboBox(self), "preferences.theme", tr("Theme"))
        for key, label in THEME_NAMES.items():
            box.addItem(label, key)
        box.setCurrentIndex(box.findData(self._settings.theme))
        box.currentIndexChanged.connect(lambda _: self._set_theme(box.currentData()))
        self._form.addRow(tr("&Theme"), box)

    def _build_first_page(self) -> None:
        self._first = named(ComboBox(self), "preferences.first", tr("At start"))
        self._first.addItems([tr("Start page"), tr("Page that was shown last")])
        self._first.setCurrentIndex(self._settings.starts_where_it_ended)
        self._first.currentIndexChanged.connect(self._set_first_page)
        self._form.addRow(tr("At &start, show"), self._first)

    def _set_first_page(self, index: int) -> None:
        self._settings.starts_where_it_ended = index == 1

    def _build_language(self) -> None:
        box = named(
            ComboBox(self),
            "preferences.language",
            tr("Language"),
            tr("Applies at the next start of the program"),
        )
        for code, name in (("", tr("Same as the system")), *LANGUAGES.items()):
            box.addItem(name, code)
        box.setCurrentIndex(box.findData(self._settings.language))
        box.currentIndexChanged.connect(lambda _: self._set_language(box.currentData()))
        self._language_note = PlainLabel(tr("Restart the program to change the language."), self)
        self._language_note.hide()
        self._form.addRow(tr("&Language"), box)
        self._form.addRow(self._language_note)

    def _build_mode(self) -> None:
        box = named(
            ComboBox(self), "preferences.mode", tr("Live depth"),
            tr("Accuracy or speed of live images, as on the Inspect page. Frozen images always "
               "have the full accuracy of the model"),
        )  # fmt: skip
        for mode in MODES:
            box.addItem(mode.label, (mode.model, mode.effort))
        kept = [(mode.model, mode.effort) for mode in MODES]
        now = self._settings.reconstruction
        box.setCurrentIndex(kept.index(now) if now in kept else 0)
        box.currentIndexChanged.connect(lambda index: self._set_mode(kept[index]))
        self._form.addRow(tr("&Live depth"), box)

    def _set_mode(self, mode: tuple[str, str]) -> None:
        self._settings.reconstruction = mode
        self.changed.emit()

    def _build_unit(self) -> None:
        box = named(
            ComboBox(self), "preferences.unit", tr("Unit of measured lengths"),
            tr("Depths and measured lengths are shown in this unit. Positions, inputs, records and "
               "files keep mm"),
        )  # fmt: skip
        for unit, text in (("mm", tr("mm")), ("um", tr("um"))):
            box.addItem(text, unit)
        box.setCurrentIndex(box.findData(self._settings.length_unit))
        box.currentIndexChanged.connect(lambda _: self._set_unit(box.currentData()))
        self._form.addRow(tr("&Unit of lengths"), box)

    def _set_unit(self, unit: str) -> None:
        self._settings.length_unit = unit
        use_length_unit(unit)
        self.changed.emit()

    def _build_workspace(self) -> None:
        self._folder = named(
            QLineEdit(str(self._settings.workspace_folder), self),
            "preferences.workspace",
            tr("Workspace folder"),
            tr("Folder for sensors, calibrations and sessions"),
        )
        self._folder.editingFinished.connect(lambda: self._set_workspace(self._folder.text()))
        choose = named(
            QPushButton(icon("folder"), "", self),
            "preferences.choose",
            tr("Choose the workspace folder"),
            tr("Choose folder"),
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
        box = named(DoubleSpinBox(self), f"preferences.{key}", label)
        box.setDecimals(decimals)
        box.setRange(low, high)
        box.setSuffix(unit)
        box.setValue(getattr(self._settings.limits, key))
        box.valueChanged.connect(self._set_limits)
        self._form.addRow(label, box)
        return box

    def _build_recording(self) -> None:
        self.recording = named(
            DoubleSpinBox(self), "preferences.recording_limit", tr("Largest recording")
        )
        self.recording.setRange(0.1, 10_000.0)
        self.recording.setDecimals(1)
        self.recording.setSuffix(tr(" GB"))
        self.recording.setValue(self._settings.recording_limit_gb)
        self.recording.setToolTip(tr("A recording stops at this size. Cameras need 2 GB a minute"))
        self.recording.valueChanged.connect(self._set_recording_limit)
        self._form.addRow(tr("Largest recording"), self.recording)

    def _set_recording_limit(self, limit_gb: float) -> None:
        self._settings.recording_limit_gb = limit_gb

    def _set_theme(self, theme: str) -> None:
        self._settings.theme = theme
        self.theme_changed.emit(theme)

    def _set_language(self, language: str) -> None:
        self._settings.language = language
        self._language_note.setVisible((language or system_language()) != current_language())

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
