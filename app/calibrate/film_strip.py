"""The captures of a step as a strip of thumbnails, each with its state."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from PySide6.QtCore import (
    QModelIndex,
    QPersistentModelIndex,
    QPoint,
    QRect,
    QSize,
    Qt,
    Signal,
)
from PySide6.QtGui import QColor, QImage, QKeyEvent, QPainter, QPaintEvent, QPen, QPixmap
from PySide6.QtWidgets import (
    QListView,
    QListWidget,
    QListWidgetItem,
    QMenu,
    QStyle,
    QStyledItemDelegate,
    QStyleOptionViewItem,
)

from app.calibrate.states import state_icon, state_meaning, state_word
from app.theme import theme
from app.widgets.label import plain_tip
from app.widgets.naming import named
from gelpolight_core.errors import InputError
from gelpolight_core.finding import Finding, Verdict, value_text
from gelpolight_core.image.file import decode_image
from gelpolight_core.translation import tr

THUMB = QSize(104, 78)
GAP = 8
PLATE = QColor(0, 0, 0, 170)


@dataclass(frozen=True, slots=True)
class Capture:
    """One capture.

    Attributes
    ----------
    path : Path
        Its image file.
    finding : Finding or None
        How it was judged. Its value is how far it is from the result of its stage.
    note : str
        Short text below the name instead of the finding, such as ``⌀ 3 mm``.
    excluded : bool
        Whether the user excluded it.
    """

    path: Path
    finding: Finding | None = None
    note: str = ""
    excluded: bool = False

    @property
    def state(self) -> str:
        """A stage state; an excluded capture is ``empty``."""
        if self.excluded:
            return "empty"
        return "waiting" if self.finding is None else self.finding.verdict.value

    @property
    def used(self) -> bool:
        """Whether its stage can use it."""
        return not self.excluded and self.state != Verdict.FAIL

    @property
    def word(self) -> str:
        """The state as a text."""
        return tr("excluded") if self.excluded else state_word(self.state)

    @property
    def residual(self) -> float:
        """How far it is from the result of its stage; NaN if it was not compared."""
        return math.nan if self.finding is None else self.finding.value

    @property
    def caption(self) -> str:
        """Short text below the name."""
        if self.finding is None:
            return self.word
        if math.isfinite(self.residual):
            return self.note or value_text(self.finding)
        return tr("not used") if self.finding.verdict is Verdict.FAIL else self.note or self.word


class FilmStrip(QListWidget):
    """The captures of one step.

    Signals
    -------
    chosen(str)
        Name of the image to show.
    excluded(str, bool)
        Exclude the image, or include it again.
    """

    chosen = Signal(str)
    excluded = Signal(str, bool)

    def __init__(self) -> None:
        super().__init__()
        named(self, "calibrate.captures", tr("Captures of this step"))
        self.setViewMode(QListView.ViewMode.IconMode)
        self.setFlow(QListView.Flow.LeftToRight)
        self.setWrapping(False)
        self.setMovement(QListView.Movement.Static)
        self.setUniformItemSizes(True)
        self.setIconSize(THUMB)
        self.setGridSize(THUMB + QSize(GAP, GAP))
        self.setFixedHeight(THUMB.height() + 3 * GAP)
        self.setProperty("plain", True)
        self.setItemDelegate(_Thumb(self))
        self.setVerticalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        self.customContextMenuRequested.connect(self._on_menu)
        self.itemClicked.connect(lambda item: self.chosen.emit(_capture_of(item).path.name))
        self.itemActivated.connect(lambda item: self.chosen.emit(_capture_of(item).path.name))
        self._thumbs: dict[tuple[Path, int], QPixmap] = {}

    def show_captures(self, captures: Sequence[Capture]) -> None:
        """Show these captures; keep the selection."""
        keep = self.current_name
        self.blockSignals(True)
        self.clear()
        for capture in captures:
            word = capture.word
            sentence = "" if capture.finding is None else capture.finding.sentence
            item = QListWidgetItem(f"{capture.path.stem}\n{capture.caption}")
            item.setData(Qt.ItemDataRole.DecorationRole, self._thumb(capture.path))
            item.setData(Qt.ItemDataRole.UserRole, capture)
            item.setToolTip(plain_tip(f"{capture.path.name}: {word}. {sentence}".strip()))
            item.setData(Qt.ItemDataRole.AccessibleTextRole, f"{capture.path.stem}, {word}")
            self.addItem(item)
            if capture.path.name == keep:
                self.setCurrentItem(item)
                self.scrollToItem(item)
        self.blockSignals(False)

    @property
    def current_name(self) -> str:
        """Name of the selected image; empty if none is selected."""
        item = self.currentItem()
        return _capture_of(item).path.name if item is not None and item.isSelected() else ""

    def show_newest(self) -> None:
        """Scroll to the newest image."""
        if self.count():
            self.scrollToItem(self.item(self.count() - 1))

    def paintEvent(self, event: QPaintEvent) -> None:
        """Show a hint while the strip is empty."""
        super().paintEvent(event)
        if not self.count():
            painter = QPainter(self.viewport())
            painter.setPen(theme.colour("muted"))
            area = self.viewport().rect()
            painter.drawText(area, Qt.AlignmentFlag.AlignCenter, tr("Captured images appear here"))
            painter.end()

    def choose(self, name: str) -> None:
        """Select an image by its name; an empty name clears the selection."""
        if not name:
            self.clearSelection()
            self.setCurrentRow(-1)
        for row in range(self.count()):
            if _capture_of(self.item(row)).path.name == name:
                self.setCurrentRow(row)
                self.scrollToItem(self.item(row))

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Delete excludes the selected image, or includes it again."""
        item = self.currentItem()
        if event.key() == Qt.Key.Key_Delete and item is not None:
            self._toggle(_capture_of(item))
            return
        super().keyPressEvent(event)
        if item is not self.currentItem() and self.currentItem() is not None:
            self.chosen.emit(self.current_name)

    def _toggle(self, capture: Capture) -> None:
        self.excluded.emit(capture.path.name, not capture.excluded)

    def _on_menu(self, position: QPoint) -> None:
        item = self.itemAt(position)
        if item is None:
            return
        capture = _capture_of(item)
        menu = QMenu(self)
        text = tr("Include") if capture.excluded else tr("Exclude")
        menu.addAction(text, lambda: self._toggle(capture))
        menu.exec(self.mapToGlobal(position))
        menu.deleteLater()

    def _thumb(self, path: Path) -> QPixmap:
        try:
            key = path, path.stat().st_mtime_ns
        except OSError:  # the file was deleted meanwhile: show an empty thumbnail
            key = path, 0
        if key not in self._thumbs:
            self._thumbs[key] = thumbnail(path)
        return self._thumbs[key]


class _Thumb(QStyledItemDelegate):
    """Draws a capture with a border in the colour of its state, and its caption in a corner."""

    def paint(
        self,
        painter: QPainter,
        option: QStyleOptionViewItem,
        index: QModelIndex | QPersistentModelIndex,
    ) -> None:
        """Draw the image, the caption, and the sign of the state."""
        capture: Capture = index.data(Qt.ItemDataRole.UserRole)
        cell: QRect = option.rect
        box = QRect(cell.center() - QPoint(THUMB.width() // 2, THUMB.height() // 2), THUMB)
        chosen = option.state & QStyle.StateFlag.State_Selected
        painter.save()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setOpacity(0.35 if capture.excluded else 1.0)
        painter.drawPixmap(box, index.data(Qt.ItemDataRole.DecorationRole))
        painter.setOpacity(1.0)
        ink = theme.colour("accent" if chosen else state_meaning(capture.state))
        painter.setPen(QPen(ink, 3.0 if chosen else 1.5))
        painter.drawRoundedRect(box, 4.0, 4.0)
        metrics = option.fontMetrics
        caption = metrics.elidedText(
            capture.caption, Qt.TextElideMode.ElideRight, THUMB.width() - 28
        )
        plate = QRect(0, 0, metrics.horizontalAdvance(caption) + 10, metrics.height() + 2)
        plate.moveBottomRight(box.bottomRight() - QPoint(3, 3))
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(PLATE)
        painter.drawRoundedRect(plate, 4.0, 4.0)
        painter.setPen(Qt.GlobalColor.white)
        painter.drawText(plate, Qt.AlignmentFlag.AlignCenter, caption)
        state_icon(capture.state).paint(painter, box.x() + 4, box.y() + 4, 16, 16)
        painter.restore()


def thumbnail(path: Path) -> QPixmap:
    """Return a thumbnail of an image file; an empty one if the file cannot be read."""
    try:
        raw = decode_image(path, cv2.IMREAD_REDUCED_COLOR_8)
    except InputError:  # reported where the image is used
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


def _capture_of(item: QListWidgetItem) -> Capture:
    capture: Capture = item.data(Qt.ItemDataRole.UserRole)
    return capture
