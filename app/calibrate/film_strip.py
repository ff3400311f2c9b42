"""The captures of a step as a strip of small pictures, each with how it fared."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from PySide6.QtCore import QPoint, QSize, Qt, Signal
from PySide6.QtGui import QIcon, QImage, QKeyEvent, QPainter, QPaintEvent, QPixmap
from PySide6.QtWidgets import QListView, QListWidget, QListWidgetItem, QMenu, QWidget

from app.calibrate.states import state_icon, state_word
from app.shell import theme
from app.widgets.label import plain_tip
from app.widgets.naming import named
from gelpolight_core.errors import InputError
from gelpolight_core.session.wholeness import decode_picture
from gelpolight_core.translation import tr

THUMB = QSize(104, 78)
HEIGHT = 136


@dataclass(frozen=True, slots=True)
class Take:
    """One capture.

    Attributes
    ----------
    path : Path
        Its file.
    state : str
        As a stage's state, or ``excluded``.
    sentence : str
        What to say of it.
    note : str
        A short word under its name, such as ``3.00 mm``.
    """

    path: Path
    state: str
    sentence: str
    note: str = ""


class FilmStrip(QListWidget):
    """The captures of one step.

    Signals
    -------
    chosen(str)
        Name of the picture to look at.
    excluded(str, bool)
        Leave the picture out, or take it in again.
    """

    chosen = Signal(str)
    excluded = Signal(str, bool)

    def __init__(self, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        named(self, "calibrate.captures", tr("Captures of this step"))
        self.setViewMode(QListView.ViewMode.IconMode)
        self.setFlow(QListView.Flow.LeftToRight)
        self.setWrapping(False)
        self.setMovement(QListView.Movement.Static)
        self.setUniformItemSizes(True)
        self.setIconSize(THUMB)
        self.setGridSize(QSize(THUMB.width() + 12, THUMB.height() + 36))
        self.setFixedHeight(HEIGHT)
        self.setVerticalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setTextElideMode(Qt.TextElideMode.ElideMiddle)
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        self.customContextMenuRequested.connect(self._on_menu)
        self.itemClicked.connect(lambda item: self.chosen.emit(_take(item).path.name))
        self.itemActivated.connect(lambda item: self.chosen.emit(_take(item).path.name))
        self._thumbs: dict[tuple[Path, int], QPixmap] = {}

    def show_takes(self, takes: Sequence[Take]) -> None:
        """Show these captures; the chosen one stays chosen."""
        keep = self.current_name
        self.blockSignals(True)
        self.clear()
        for take in takes:
            word = tr("left out") if take.state == "excluded" else state_word(take.state)
            item = QListWidgetItem(self._icon(take), f"{take.path.stem}\n{take.note or word}")
            item.setData(Qt.ItemDataRole.UserRole, take)
            item.setToolTip(plain_tip(f"{take.path.name}: {word}. {take.sentence}".strip()))
            item.setData(Qt.ItemDataRole.AccessibleTextRole, f"{take.path.stem}, {word}")
            self.addItem(item)
            if take.path.name == keep:
                self.setCurrentItem(item)
        self.blockSignals(False)

    @property
    def current_name(self) -> str:
        """Name of the chosen picture; empty where none is."""
        item = self.currentItem()
        return _take(item).path.name if item is not None and item.isSelected() else ""

    def show_newest(self) -> None:
        """Bring the newest picture into sight."""
        if self.count():
            self.scrollToItem(self.item(self.count() - 1))

    def paintEvent(self, event: QPaintEvent) -> None:
        """Say so where there is nothing."""
        super().paintEvent(event)
        if not self.count():
            painter = QPainter(self.viewport())
            painter.setPen(theme.colour("muted"))
            area = self.viewport().rect()
            painter.drawText(area, Qt.AlignmentFlag.AlignCenter, tr("Captures come here"))
            painter.end()

    def choose(self, name: str) -> None:
        """Choose a picture by its name; none by an empty one."""
        if not name:
            self.clearSelection()
            self.setCurrentRow(-1)
        for row in range(self.count()):
            if _take(self.item(row)).path.name == name:
                self.setCurrentRow(row)
                self.scrollToItem(self.item(row))

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Delete leaves the chosen picture out, or takes it in again."""
        item = self.currentItem()
        if event.key() == Qt.Key.Key_Delete and item is not None:
            self._toggle(_take(item))
            return
        super().keyPressEvent(event)
        if item is not self.currentItem() and self.currentItem() is not None:
            self.chosen.emit(self.current_name)

    def _toggle(self, take: Take) -> None:
        self.excluded.emit(take.path.name, take.state != "excluded")

    def _on_menu(self, place: QPoint) -> None:
        item = self.itemAt(place)
        if item is None:
            return
        take = _take(item)
        menu = QMenu(self)
        text = tr("Take in again") if take.state == "excluded" else tr("Leave out")
        menu.addAction(text, lambda: self._toggle(take))
        menu.exec(self.mapToGlobal(place))
        menu.deleteLater()

    def _icon(self, take: Take) -> QIcon:
        picture = QPixmap(self._thumb(take.path))
        painter = QPainter(picture)
        if take.state == "excluded":
            painter.fillRect(picture.rect(), Qt.GlobalColor.black)
            painter.setOpacity(0.35)
            painter.drawPixmap(0, 0, self._thumb(take.path))
            painter.setOpacity(1.0)
        sign = "empty" if take.state == "excluded" else take.state
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(self.palette().base())
        painter.drawEllipse(2, 2, 20, 20)
        state_icon(sign).paint(painter, 3, 3, 18, 18)
        painter.end()
        return QIcon(picture)

    def _thumb(self, path: Path) -> QPixmap:
        try:
            key = path, path.stat().st_mtime_ns
        except OSError:  # removed by hand meanwhile: an empty place tells it
            key = path, 0
        if key not in self._thumbs:
            self._thumbs[key] = thumbnail(path)
        return self._thumbs[key]


def thumbnail(path: Path) -> QPixmap:
    """Return a small picture of a file; an empty one where it cannot be read."""
    try:
        raw = decode_picture(path, cv2.IMREAD_REDUCED_COLOR_8)
    except InputError:  # told where the picture is used
        raw = None
    if raw is None:
        empty = QPixmap(THUMB)
        empty.fill(Qt.GlobalColor.darkGray)
        return empty
    rgb = np.ascontiguousarray(raw[..., ::-1])
    rows, columns = rgb.shape[:2]
    image = QImage(rgb.data, columns, rows, 3 * columns, QImage.Format.Format_RGB888)
    scaled = QPixmap.fromImage(image).scaled(
        THUMB,
        Qt.AspectRatioMode.KeepAspectRatioByExpanding,
        Qt.TransformationMode.SmoothTransformation,
    )
    return scaled.copy(
        (scaled.width() - THUMB.width()) // 2,
        (scaled.height() - THUMB.height()) // 2,
        THUMB.width(),
        THUMB.height(),
    )


def _take(item: QListWidgetItem) -> Take:
    take: Take = item.data(Qt.ItemDataRole.UserRole)
    return take
