"""The button that says where pictures come from, and lets another source be chosen."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QFileDialog, QMenu, QToolButton, QWidget

from app.shell.context import AppContext
from app.sources.source import SourceInfo
from app.widgets.label import plain_tip
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
        self._page, self._found = page, list[QAction]()
        self._cameras_end = menu.addSeparator()
        for name, text, choose in (
            ("virtual", tr("Virtual sensor"), context.source.choose_virtual_sensor),
            ("folder", tr("Folder of pictures…"), self.choose_folder),
            ("recording", tr("Recording…"), self.choose_recording),
            ("none", none, lambda: context.source.choose(None)),
        ):
            action = menu.addAction(text, choose)
            action.setObjectName(f"{page}.source.{name}")
        menu.addSeparator()
        self._settings = menu.addAction(tr("Camera settings…"), self.show_settings)
        self._settings.setObjectName(f"{page}.source.settings")
        menu.aboutToShow.connect(self.list_cameras)
        self.setMenu(menu)
        context.source.changed.connect(self._show)
        self._show()

    def list_cameras(self) -> None:
        """Offer the cameras that are plugged in now."""
        menu = self.menu()
        for action in self._found:
            menu.removeAction(action)
            action.deleteLater()
        infos = self._context.cameras.infos()
        self._found = [QAction(info.name, menu) for info in infos] or [
            QAction(tr("No camera is plugged in"), menu)
        ]
        for number, action in enumerate(self._found):
            action.setObjectName(f"{self._page}.source.camera.{number}")
            action.setEnabled(bool(infos))
            if infos:
                info = infos[number]
                action.setToolTip(plain_tip(info.detail))
                action.triggered.connect(lambda _=False, info=info: self.use_camera(info))
        menu.insertActions(self._cameras_end, self._found)

    def use_camera(self, info: SourceInfo) -> None:
        """Take the pictures of a camera; choosing the same one again changes nothing."""
        now = self._context.source.info
        if now is None or (now.kind, now.detail) != (info.kind, info.detail):
            self._context.source.choose(info)

    def show_settings(self) -> None:
        """Show how the camera is set, and let it be set."""
        show_settings_of_source(self._context, self)

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
        self._settings.setEnabled(info is not None and info.kind == "camera")


def show_settings_of_source(context: AppContext, parent: QWidget) -> None:
    """Show the settings of the camera that is the source; nothing where it is none."""
    camera = context.cameras.of(context.source.info)
    if camera is not None:
        from app.cameras.dialog import show_camera_dialog  # when it is first wanted

        show_camera_dialog(context.cameras, camera, parent)
