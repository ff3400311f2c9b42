"""The recordings of the workspace, each with its first image."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
from pathlib import Path

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QPixmap
from PySide6.QtWidgets import QListWidget, QListWidgetItem, QWidget

from app.widgets.buttons import Slot, push_button
from app.widgets.dialog import Dialog, Kinds
from app.widgets.label import PlainLabel, plain_tip
from app.widgets.layout import hbox, vbox
from app.widgets.naming import named
from app.widgets.pixmaps import pixmap_of
from gelpolight_core.errors import InputError

PREVIEW = QSize(320, 240)


def read_preview(path: Path) -> tuple[str, QPixmap]:
    """Return what there is to say of a recording, and its first image."""
    from gelpolight_core.recording.reader import Recording  # slow import: loads NumPy

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
        self.list = named(QListWidget(self), "recordings.list", "Recordings, newest first")
        self.list.setMinimumWidth(300)
        for path in recordings:
            item = QListWidgetItem(_line(path))
            item.setData(Qt.ItemDataRole.UserRole, str(path))
            item.setToolTip(plain_tip(str(path)))
            self.list.addItem(item)
        self.image = named(PlainLabel(parent=self), "recordings.image", "First image")
        self.image.setFixedSize(PREVIEW)
        self.image.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.text = named(PlainLabel(parent=self, wrap=True), "recordings.text", "Description")
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
