"""The captures of a step as a strip of thumbnails, each with its state."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
from PySide6.QtCore import (
    QModelIndex,
    QPersistentModelIndex,
    QPoint,
    QRect,
    QSize,
    Qt,
    Signal,
)
from PySide6.QtGui import QColor, QKeyEvent, QPainter, QPaintEvent, QPen, QPixmap
from PySide6.QtWidgets import (
    QListView,
    QListWidget,
    QListWidgetItem,
    QMenu,
    QStyle,
    QStyledItemDelegate,
    QStyleOptionViewItem,
)

from app.calibrate.page_state import Capture, state_icon, state_meaning
from app.theme import theme
from app.widgets.label import plain_tip
from app.widgets.naming import named
from app.widgets.pixmaps import pixmap_of
from gelpolight_core.errors import InputError
from gelpolight_core.session.images import read_raw_image

THUMB = QSize(104, 78)
GAP = 8
PLATE = QColor(0, 0, 0, 170)


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
        named(self, "calibrate.captures", "Captures of this step")
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
        for opened in (self.itemClicked, self.itemActivated):
            opened.connect(lambda item: self.chosen.emit(_capture_of(item).path.name))
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
            painter.drawText(area, Qt.AlignmentFlag.AlignCenter, "Captured images appear here")
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
        text = "Include" if capture.excluded else "Exclude"
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
        rgb = read_raw_image(path).rgb
    except InputError:  # reported where the image is used
        empty = QPixmap(THUMB)
        empty.fill(Qt.GlobalColor.darkGray)
        return empty
    width, height = THUMB.toTuple()
    factor = max(width / rgb.shape[1], height / rgb.shape[0])
    size = max(round(factor * rgb.shape[1]), width), max(round(factor * rgb.shape[0]), height)
    x, y = (size[0] - width) // 2, (size[1] - height) // 2
    kind = cv2.INTER_AREA if factor < 1.0 else cv2.INTER_LINEAR
    scaled = cv2.resize(rgb, size, interpolation=kind)
    return pixmap_of(scaled[y : y + height, x : x + width])


def _capture_of(item: QListWidgetItem) -> Capture:
    capture: Capture = item.data(Qt.ItemDataRole.UserRole)
    return capture
