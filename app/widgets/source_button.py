"""The button that says where pictures come from, and lets another source be chosen."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QFileDialog, QMenu, QToolButton, QWidget

from app.shell.context import AppContext
from app.widgets.naming import named
from gelpolight_core.recording.recording import ENDING
from gelpolight_core.translation import tr


class SourceButton(QToolButton):
    """Shows the source in use; its menu offers the others.

    Parameters
    ----------
    context : AppContext
        With the choice that all pages share.
    page : str
        First part of its object name.
    none : str
        What the choice of no camera is called.
    """

    def __init__(
        self, *, context: AppContext, page: str, none: str, parent: QWidget | None = None
    ) -> None:
        super().__init__(parent)
        self._context = context
        named(self, f"{page}.source", tr("Camera"), tr("Where the live picture comes from"))
        self.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextOnly)
        self.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        menu = QMenu(self)
        menu.setObjectName(f"{page}.source.menu")
        for name, text, choose in (
            ("none", none, lambda: context.source.choose(None)),
            ("virtual", tr("Virtual sensor"), context.source.choose_virtual_sensor),
            ("folder", tr("Folder of pictures…"), self.choose_folder),
            ("recording", tr("Recording…"), self.choose_recording),
        ):
            action = menu.addAction(text, choose)
            action.setObjectName(f"{page}.source.{name}")
        self.setMenu(menu)
        context.source.changed.connect(self._show)
        self._show()

    def choose_folder(self) -> None:
        """Let the person choose a folder whose pictures play the camera."""
        chosen = QFileDialog.getExistingDirectory(
            self, tr("Folder of pictures"), str(self._context.settings.last_folder)
        )
        if chosen:
            self.use_folder(Path(chosen))

    def use_folder(self, folder: Path) -> None:
        """Take the pictures of a folder as the camera's."""
        self._context.settings.last_folder = folder
        self._context.source.choose_folder(folder)

    def choose_recording(self) -> None:
        """Let the person choose a recording that plays the camera."""
        chosen, _ = QFileDialog.getOpenFileName(
            self,
            tr("Recording"),
            str(self._context.settings.last_folder),
            tr("Recordings (*{ending})").format(ending=ENDING),
        )
        if chosen:
            self.use_recording(Path(chosen))

    def use_recording(self, file: Path) -> None:
        """Take the frames of a recording as the camera's."""
        self._context.settings.last_folder = file.parent
        self._context.source.choose_recording(file)

    def _show(self) -> None:
        info = self._context.source.info
        name = tr("none") if info is None else info.name
        self.setText(tr("Camera: {name}").format(name=name))
