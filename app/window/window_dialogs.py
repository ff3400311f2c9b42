"""Preferences, and the about box: the program, the versions of its parts and the licences."""

from __future__ import annotations

import platform
from collections.abc import Callable
from dataclasses import replace
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from PySide6.QtCore import Qt, qVersion
from PySide6.QtGui import QFontDatabase, QGuiApplication
from PySide6.QtWidgets import QPlainTextEdit, QWidget

from app.program.context import AppContext
from app.widgets.actions import push_button
from app.widgets.dialog import Dialog
from app.widgets.forms import Form
from app.widgets.icons import application_icon
from app.widgets.label import MarkupLabel, PlainLabel, escaped
from app.widgets.layout import hbox, vbox
from app.widgets.widget_names import set_names
from gelpolight_core.base.version import __version__


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


# A packaged program contains the licences of all its parts. In other installations each library has
# its own.
LICENCES = Path(__file__).resolve().parents[2] / "LICENCES.txt"
PARTS = (
    "PySide6-Essentials",
    "pyqtgraph",
    "numpy",
    "scipy",
    "numba",
    "opencv-contrib-python-headless",
    "matplotlib",
    "tifffile",
    "trimesh",
    "typst",
    "pyvista",
    "pyvistaqt",
    "vtk",
)


def versions() -> tuple[tuple[str, str], ...]:
    """Return the name and version of the program and of its installed parts."""
    parts = [
        ("GelPoLight Studio", __version__),
        ("Python", platform.python_version()),
        ("Qt", qVersion()),
    ]
    for part in PARTS:
        try:
            parts.append((part, version(part)))
        except PackageNotFoundError:
            continue  # an optional part
    parts.append(("System", platform.platform()))
    return tuple(parts)


class AboutDialog(Dialog):
    """The information to include in a question or bug report."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent, "about", "About GelPoLight Studio", once=True)
        sign = PlainLabel()
        sign.setPixmap(application_icon().pixmap(64, 64))
        title = MarkupLabel(f"<h2>GelPoLight Studio {__version__}</h2>")
        what = PlainLabel(
            "Calibrates a point-lit tactile sensor, shows its depth map and measures "
            "pressed objects."
        )
        rows = "".join(
            f"<tr><td>{escaped(name)}&nbsp;&nbsp;</td><td>{escaped(number)}</td></tr>"
            for name, number in versions()
        )
        table = set_names(MarkupLabel(f"<table>{rows}</table>"), "about.versions", "Versions")
        table.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        licences = PlainLabel(
            "Licence: BSD 3-Clause. Qt and PySide6 are used under the LGPL 3. The "
            "other parts have BSD, MIT, Apache and PSF licences."
        )
        for text in (what, licences):
            text.setWordWrap(True)
        copy = push_button(
            "about.copy",
            "Copy",
            self.copy,
            icon_name="copy",
            accessible="Copy the version numbers",
        )
        texts = push_button(
            "about.licences",
            "Licences…",
            self.show_licences,
            accessible="Licences of all parts",
        )
        top = hbox((sign, 0, Qt.AlignmentFlag.AlignTop), (vbox(title, what), 1))
        self.fill(top, table, licences, add=(copy, texts) if LICENCES.is_file() else (copy,))

    def show_licences(self) -> None:
        """Show the licences of all parts that are packaged with the program."""
        dialog = Dialog(self, "licences", "Licences of all parts", once=True)
        dialog.resize(800, 600)
        text = QPlainTextEdit(LICENCES.read_text("utf-8"))
        set_names(text, "licences.text", "Licences")
        text.setReadOnly(True)
        text.setFont(QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont))
        dialog.fill(text)
        dialog.show()

    def copy(self) -> None:
        """Copy the versions to the clipboard."""
        text = "\n".join(f"{name} {number}" for name, number in versions())
        QGuiApplication.clipboard().setText(text)
