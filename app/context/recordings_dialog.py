"""The recordings of the workspace, each with its first image."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from PySide6.QtCore import QSize, Qt, Signal
from PySide6.QtGui import QImage, QPixmap
from PySide6.QtWidgets import QListWidget, QListWidgetItem, QWidget

from app.widgets.buttons import push_button
from app.widgets.dialog import Dialog, Kinds
from app.widgets.label import PlainLabel, plain_tip
from app.widgets.layout import hbox, vbox
from app.widgets.naming import named
from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr

PREVIEW = QSize(320, 240)


@dataclass(frozen=True, slots=True)
class Preview:
    """What the list shows of a recording.

    Attributes
    ----------
    text : str
        Its length, images and losses, or why it cannot be read.
    image : QImage or None
        Its first image.
    """

    text: str
    image: QImage | None = None


def read_preview(path: Path) -> Preview:
    """Read the description and the first image of a recording."""
    from gelpolight_core.recording.reader import Recording  # slow import: loads NumPy

    try:
        recording = Recording.open(path)
    except InputError as error:
        return Preview(str(error))
    try:
        text = tr("{n} frames, {s:.1f} s, {w} x {h} px, {lost} lost").format(
            n=len(recording),
            s=recording.duration_s,
            w=recording.size[0],
            h=recording.size[1],
            lost=recording.lost,
        )
        if not len(recording):
            return Preview(text)
        rgb = recording.frame(0).rgb
        kind = QImage.Format.Format_RGB888
        if rgb.dtype.itemsize == 2:
            rgb = (rgb >> 8).astype("uint8")
        image = QImage(rgb.data, rgb.shape[1], rgb.shape[0], 3 * rgb.shape[1], kind)
        return Preview(text, image.copy())
    except InputError as error:
        return Preview(str(error))
    finally:
        recording.close()


class RecordingsDialog(Dialog):
    """Lets the user choose a recording.

    Parameters
    ----------
    recordings : tuple of Path
        The recordings, newest first.
    parent : QWidget
        The window.

    Signals
    -------
    chosen(str)
        Path of the recording to play.
    other_wanted()
        The user wants to choose another file.
    """

    chosen = Signal(str)
    other_wanted = Signal()

    def __init__(self, recordings: tuple[Path, ...], parent: QWidget) -> None:
        super().__init__(parent, "recordings", tr("Recordings"), Kinds.Cancel, once=True)
        self.list = named(QListWidget(self), "recordings.list", tr("Recordings, newest first"))
        self.list.setMinimumWidth(300)
        for path in recordings:
            item = QListWidgetItem(_line(path))
            item.setData(Qt.ItemDataRole.UserRole, str(path))
            item.setToolTip(plain_tip(str(path)))
            self.list.addItem(item)
        self.image = named(PlainLabel(parent=self), "recordings.image", tr("First image"))
        self.image.setFixedSize(PREVIEW)
        self.image.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self.text = named(PlainLabel(parent=self, wrap=True), "recordings.text", tr("Description"))
        self.text.setFixedWidth(PREVIEW.width())
        if not recordings:
            self.text.setText(tr("There are no recordings yet. Inspect has a Record button."))
        self.play_button = push_button("recordings.play", tr("Play"), self.play_chosen)
        self.play_button.setDefault(True)
        self.other_button = push_button(
            "recordings.other", tr("Other file…"), self._ask_for_other, accessible=tr("Other file")
        )
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
            self.chosen.emit(item.data(Qt.ItemDataRole.UserRole))

    def _ask_for_other(self) -> None:
        self.accept()
        self.other_wanted.emit()

    def _show_chosen(self, item: QListWidgetItem | None) -> None:
        if item is None:
            return
        preview = read_preview(Path(item.data(Qt.ItemDataRole.UserRole)))
        self.text.setText(preview.text)
        pixmap = QPixmap() if preview.image is None else QPixmap.fromImage(preview.image)
        if not pixmap.isNull():
            pixmap = pixmap.scaled(
                PREVIEW,
                Qt.AspectRatioMode.KeepAspectRatio,
                Qt.TransformationMode.SmoothTransformation,
            )
        self.image.setPixmap(pixmap)


def _line(path: Path) -> str:
    stat = path.stat()
    when = datetime.fromtimestamp(stat.st_mtime).astimezone()
    size = tr("{mb:.0f} MB").format(mb=1e-6 * stat.st_size)
    return f"{path.parent.parent.name}   {when:%Y-%m-%d %H:%M}   {size}"
