"""The button that shows the image source and lets the user select another one."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
from pathlib import Path

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QAction, QPixmap
from PySide6.QtWidgets import QListWidget, QListWidgetItem, QMenu, QToolButton, QWidget

from app.program.context import AppContext
from app.program.file_dialogs import ask_folder, ask_open
from app.sources.source import SourceInfo
from app.widgets.actions import Slot, add_item, push_button
from app.widgets.dialog import Dialog, Kinds
from app.widgets.icons import pixmap_of
from app.widgets.label import PlainLabel, plain_tip
from app.widgets.layout import hbox, vbox
from app.widgets.text_roles import set_background_role
from app.widgets.widget_names import set_names
from gelpolight_core.base.errors import InputError
from gelpolight_core.output.recording.recording_format import ENDING

PREVIEW = QSize(320, 240)


def read_preview(path: Path) -> tuple[str, QPixmap]:
    """Return a description of a recording with its first image."""
    from gelpolight_core.output.recording.recording_reader import (
        Recording,  # slow import: loads NumPy
    )

    try:
        with Recording.open(path) as recording:
            text = (
                f"{len(recording)} frames, {recording.duration_s:.1f} s, {recording.size[0]} "
                f"x {recording.size[1]} px, {recording.lost} lost"
            )
            return text, pixmap_of(recording.frame(0).rgb) if len(recording) else QPixmap()
    except InputError as error:
        return str(error), QPixmap()


class RecordingsDialog(Dialog):
    """Lets the user choose a recording.

    Parameters
    ----------
    recordings : tuple of Path
        The recordings, newest first.
    play : callable
        Called with the recording to play.
    choose_other : callable
        Called to choose another file.
    parent : QWidget
        The window.
    """

    def __init__(
        self,
        recordings: tuple[Path, ...],
        play: Callable[[Path], object],
        choose_other: Slot,
        parent: QWidget,
    ) -> None:
        super().__init__(parent, "recordings", "Recordings", Kinds.Cancel, once=True)
        self._play = play
        self.list = set_names(QListWidget(self), "recordings.list", "Recordings, newest first")
        self.list.setMinimumWidth(300)
        for path in recordings:
            item = QListWidgetItem(_line(path))
            item.setData(Qt.ItemDataRole.UserRole, str(path))
            item.setToolTip(plain_tip(str(path)))
            self.list.addItem(item)
        self.image = set_names(PlainLabel(parent=self), "recordings.image", "First image")
        self.image.setFixedSize(PREVIEW)
        self.image.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.text = set_names(PlainLabel(parent=self, wrap=True), "recordings.text", "Description")
        self.text.setFixedWidth(PREVIEW.width())
        if not recordings:
            self.text.setText("There are no recordings yet. Inspect has a Record button.")
        self.play_button = push_button("recordings.play", "Play", self.play_chosen)
        self.play_button.setDefault(True)
        self.other_button = push_button(
            "recordings.other", "Other file…", self.accept, accessible="Other file"
        )
        self.other_button.clicked.connect(lambda _=False: choose_other())
        self.list.currentItemChanged.connect(self._show_chosen)
        self.list.itemDoubleClicked.connect(lambda _: self.play_chosen())
        row = hbox((self.list, 1), vbox(self.image, self.text, None))
        self.fill((row, 1), add=(self.play_button, self.other_button))
        self.list.setCurrentRow(0)
        self.play_button.setEnabled(bool(recordings))

    def play_chosen(self) -> None:
        """Play the selected recording."""
        item = self.list.currentItem()
        if item is not None:
            self.accept()
            self._play(Path(item.data(Qt.ItemDataRole.UserRole)))

    def _show_chosen(self, item: QListWidgetItem | None) -> None:
        if item is not None:
            text, image = read_preview(Path(item.data(Qt.ItemDataRole.UserRole)))
            whole, smooth = Qt.AspectRatioMode.KeepAspectRatio, Qt.TransformationMode
            self.text.setText(text)
            if not image.isNull():
                image = image.scaled(PREVIEW, whole, smooth.SmoothTransformation)
            self.image.setPixmap(image)


def _line(path: Path) -> str:
    stat = path.stat()
    when = datetime.fromtimestamp(stat.st_mtime).astimezone()
    size = f"{1e-6 * stat.st_size:.0f} MB"
    return f"{path.parent.parent.name}   {when:%Y-%m-%d %H:%M}   {size}"


class SourceButton(QToolButton):
    """Shows the source in use. Its menu offers the others.

    Parameters
    ----------
    context : AppContext
        Holds the source that all pages share.
    """

    def __init__(self, *, context: AppContext, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._context = context
        set_names(self, "state.camera", "Camera", "Source of the live image")
        self.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextOnly)
        self.setPopupMode(QToolButton.ToolButtonPopupMode.InstantPopup)
        menu = QMenu(self)
        menu.setObjectName("state.camera.menu")
        self._found = list[QAction]()
        self._cameras_end = menu.addSeparator()
        for name, text, choose in (
            ("virtual", "Virtual sensor", context.source.choose_virtual_sensor),
            ("folder", "Folder of images…", self.choose_folder),
            ("recording", "Recording…", self.show_recordings),
            ("none", "No camera", lambda: context.source.choose(None)),
        ):
            add_item(menu, f"state.camera.{name}", text, choose)
        menu.addSeparator()
        self._settings = add_item(
            menu, "state.camera.settings", "Camera settings…", self.show_settings
        )
        menu.aboutToShow.connect(self.list_cameras)
        self.setMenu(menu)
        context.source.changed.connect(self._show)
        context.status.changed.connect(self._show)
        self._show()

    def open_menu(self) -> None:
        """Show the menu below the button."""
        self.setFocus()
        self.menu().popup(self.mapToGlobal(self.rect().bottomLeft()))

    def list_cameras(self) -> None:
        """Offer the cameras that are connected now."""
        menu = self.menu()
        for action in self._found:
            menu.removeAction(action)
            action.deleteLater()
        infos = self._context.cameras.infos()
        self._found = [QAction(info.name, menu) for info in infos] or [
            QAction("No camera connected", menu)
        ]
        for number, action in enumerate(self._found):
            action.setObjectName(f"state.camera.{number}")
            action.setEnabled(bool(infos))
            if infos:
                info = infos[number]
                action.setToolTip(plain_tip(info.detail))
                action.triggered.connect(lambda _=False, info=info: self.use_camera(info))
        menu.insertActions(self._cameras_end, self._found)

    def use_camera(self, info: SourceInfo) -> None:
        """Use the images of a camera. Selecting the same camera again changes nothing."""
        now = self._context.source.info
        if now is None or (now.kind, now.detail) != (info.kind, info.detail):
            self._context.source.choose(info)

    def show_settings(self) -> None:
        """Show the camera settings and let the user change them."""
        show_settings_of_source(self._context, self)

    def choose_folder(self) -> None:
        """Let the user choose a folder whose images replace the camera."""
        folder = ask_folder(self, self._context.settings, "images", "Folder of images")
        if folder is not None:
            self.use_folder(folder)

    def use_folder(self, folder: Path) -> None:
        """Use the images of a folder instead of a camera."""
        self._context.settings.keep_folder("images", folder)
        self._context.source.choose_folder(folder)

    def show_recordings(self) -> RecordingsDialog:
        """Show the recordings of the workspace, to play one instead of the camera."""
        recordings, use = self._context.workspace.recordings(), self.use_recording
        dialog = RecordingsDialog(recordings, use, self.choose_recording, self)
        dialog.open()
        return dialog

    def choose_recording(self) -> None:
        """Let the user choose the file of a recording that replaces the camera."""
        patterns = f"Recordings (*{ENDING})"
        file = ask_open(self, self._context.settings, "recording", "Recording", patterns)
        if file is not None:
            self.use_recording(file)

    def use_recording(self, file: Path) -> None:
        """Use the frames of a recording instead of a camera."""
        self._context.settings.keep_folder("recording", file.parent)
        self._context.source.choose_recording(file)

    def _show(self) -> None:
        info, status = self._context.source.info, self._context.status.value
        parts = ("No camera" if info is None else info.name, status.camera_note)
        self.setText(", ".join(filter(None, parts)))
        set_background_role(self, "warn" if status.camera_note else "")
        self._settings.setEnabled(info is not None and info.kind == "camera")


def show_settings_of_source(context: AppContext, parent: QWidget) -> None:
    """Show the settings of the camera in use. Nothing happens if the source is not a camera."""
    camera = context.cameras.of(context.source.info)
    if camera is not None:
        from .camera_dialog import show_camera_dialog  # created at first use

        dialog = show_camera_dialog(context.cameras, camera, parent)
        # It keeps the camera open, which another window of the program may use next.
        context.source.changed.connect(dialog.close)
