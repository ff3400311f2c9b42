"""About box: the program, the versions of its parts and their licences."""

from __future__ import annotations

import platform
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from PySide6.QtCore import Qt, qVersion
from PySide6.QtGui import QFontDatabase, QGuiApplication
from PySide6.QtWidgets import (
    QDialog,
    QDialogButtonBox,
    QHBoxLayout,
    QPlainTextEdit,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from app.theme.icons import application_icon, icon
from app.widgets.label import MarkupLabel, PlainLabel, escaped
from app.widgets.naming import named
from gelpolight_core import __version__
from gelpolight_core.translation import tr

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
    "pyvista",
    "pyvistaqt",
    "vtk",
)


def versions() -> tuple[tuple[str, str], ...]:
    """Return the name and version of the program and of its installed parts."""
    found = [
        ("GelPoLight Studio", __version__),
        ("Python", platform.python_version()),
        ("Qt", qVersion()),
    ]
    for part in PARTS:
        try:
            found.append((part, version(part)))
        except PackageNotFoundError:
            continue  # an optional part
    found.append((tr("System"), platform.platform()))
    return tuple(found)


class AboutDialog(QDialog):
    """The information to include in a question or bug report."""

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        named(self, "about", tr("About GelPoLight Studio"))
        self.setWindowTitle(tr("About GelPoLight Studio"))
        sign = PlainLabel(parent=self)
        sign.setPixmap(application_icon().pixmap(64, 64))
        title = MarkupLabel(f"<h2>GelPoLight Studio {__version__}</h2>", self)
        what = PlainLabel(
            tr(
                "Calibrates a point-lit tactile sensor, shows its depth map and measures "
                "pressed objects."
            ),
            self,
        )
        what.setWordWrap(True)
        words = QVBoxLayout()
        words.addWidget(title)
        words.addWidget(what)
        top = QHBoxLayout()
        top.addWidget(sign, 0, Qt.AlignmentFlag.AlignTop)
        top.addLayout(words, 1)
        rows = "".join(
            f"<tr><td>{escaped(name)}&nbsp;&nbsp;</td><td>{escaped(number)}</td></tr>"
            for name, number in versions()
        )
        table = named(MarkupLabel(f"<table>{rows}</table>", self), "about.versions", tr("Versions"))
        table.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        licences = PlainLabel(
            tr(
                "Licence: BSD 3-Clause. Qt and PySide6 are used under the LGPL 3. The "
                "other parts have BSD, MIT, Apache and PSF licences."
            ),
            self,
        )
        licences.setWordWrap(True)
        copy = named(
            QPushButton(icon("copy"), tr("Copy"), self),
            "about.copy",
            tr("Copy the version numbers"),
        )
        copy.clicked.connect(self.copy)
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close, self)
        buttons.addButton(copy, QDialogButtonBox.ButtonRole.ActionRole)
        if LICENCES.is_file():
            texts = named(
                QPushButton(tr("Licences…"), self), "about.licences", tr("Licences of all parts")
            )
            texts.clicked.connect(self.show_licences)
            buttons.addButton(texts, QDialogButtonBox.ButtonRole.ActionRole)
        buttons.rejected.connect(self.reject)
        layout = QVBoxLayout(self)
        layout.addLayout(top)
        layout.addWidget(table)
        layout.addWidget(licences)
        layout.addWidget(buttons)

    def show_licences(self) -> None:
        """Show the licences of all parts that are packaged with the program."""
        dialog = named(QDialog(self), "licences", tr("Licences of all parts"))
        dialog.setWindowTitle(tr("Licences of all parts"))
        dialog.setAttribute(Qt.WidgetAttribute.WA_DeleteOnClose)
        dialog.resize(800, 600)
        text = QPlainTextEdit(LICENCES.read_text("utf-8"), dialog)
        named(text, "licences.text", tr("Licences"))
        text.setReadOnly(True)
        text.setFont(QFontDatabase.systemFont(QFontDatabase.SystemFont.FixedFont))
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close, dialog)
        buttons.rejected.connect(dialog.reject)
        layout = QVBoxLayout(dialog)
        layout.addWidget(text)
        layout.addWidget(buttons)
        dialog.show()

    def copy(self) -> None:
        """Copy the versions to the clipboard."""
        text = "\n".join(f"{name} {number}" for name, number in versions())
        QGuiApplication.clipboard().setText(text)
