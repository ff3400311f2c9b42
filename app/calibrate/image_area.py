"""The centre of a step with images: live image or capture, results, and the film strip."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import cv2
from PySide6.QtCore import (
    QEvent,
    QModelIndex,
    QObject,
    QPersistentModelIndex,
    QPoint,
    QRect,
    QSize,
    Qt,
    Signal,
)
from PySide6.QtGui import QColor, QKeyEvent, QPainter, QPaintEvent, QPen, QPixmap
from PySide6.QtWidgets import (
    QFrame,
    QListView,
    QListWidget,
    QListWidgetItem,
    QMenu,
    QPushButton,
    QSizePolicy,
    QStackedWidget,
    QStyle,
    QStyledItemDelegate,
    QStyleOptionViewItem,
    QToolButton,
    QWidget,
)

from app.live.live_view import LiveView
from app.sources.stream import Stream
from app.widgets import theme
from app.widgets.icons import pixmap_of
from app.widgets.label import PlainLabel, plain_tip
from app.widgets.layout import hbox, vbox
from app.widgets.status_icon import StatusIcon
from app.widgets.text_roles import named_label, set_background_role
from app.widgets.timers import timer
from app.widgets.widget_names import set_names
from gelpolight_core.base.arrays import PixelArray
from gelpolight_core.base.errors import InputError
from gelpolight_core.session.session_images import read_raw_image

from .image_panels import MapsView
from .page_state import Capture, PageState, state_icon, state_meaning, state_word

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
        set_names(self, "calibrate.captures", "Captures of this step")
        self.setViewMode(QListView.ViewMode.IconMode)
        self.setFlow(QListView.Flow.LeftToRight)
        self.setWrapping(False)
        self.setMovement(QListView.Movement.Static)
        self.setUniformItemSizes(True)
        self.setIconSize(THUMB)
        self.setGridSize(THUMB + QSize(GAP, GAP))
        self.setFixedHeight(THUMB.height() + 3 * GAP)
        self.setProperty("plain", True)
        self.setItemDelegate(_ThumbnailDelegate(self))
        self.setVerticalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.CustomContextMenu)
        self.customContextMenuRequested.connect(self._on_menu)
        for opened in (self.itemClicked, self.itemActivated):
            opened.connect(lambda item: self.chosen.emit(_capture_of(item).path.name))
        self._thumbs: dict[tuple[Path, int], QPixmap] = {}

    def show_captures(self, captures: Sequence[Capture]) -> None:
        """Show these captures, and keep the selection."""
        selected_name = self.current_name
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
            if capture.path.name == selected_name:
                self.setCurrentItem(item)
                self.scrollToItem(item)
        self.blockSignals(False)

    @property
    def current_name(self) -> str:
        """Name of the selected image, or an empty text."""
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
        """Select an image by its name. An empty name clears the selection."""
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


class _ThumbnailDelegate(QStyledItemDelegate):
    """Draws a capture with a border in the colour of its state and a caption in a corner."""

    def paint(
        self,
        painter: QPainter,
        option: QStyleOptionViewItem,
        index: QModelIndex | QPersistentModelIndex,
    ) -> None:
        """Draw the image, the caption, and the sign of the state."""
        capture: Capture = index.data(Qt.ItemDataRole.UserRole)
        cell: QRect = option.rect
        frame = QRect(cell.center() - QPoint(THUMB.width() // 2, THUMB.height() // 2), THUMB)
        is_selected = option.state & QStyle.StateFlag.State_Selected
        painter.save()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setOpacity(0.35 if capture.excluded else 1.0)
        painter.drawPixmap(frame, index.data(Qt.ItemDataRole.DecorationRole))
        painter.setOpacity(1.0)
        colour = theme.colour("accent" if is_selected else state_meaning(capture.state))
        painter.setPen(QPen(colour, 3.0 if is_selected else 1.5))
        painter.drawRoundedRect(frame, 4.0, 4.0)
        metrics = option.fontMetrics
        width = THUMB.width() - 28
        caption = metrics.elidedText(capture.caption, Qt.TextElideMode.ElideRight, width)
        plate = QRect(0, 0, metrics.horizontalAdvance(caption) + 10, metrics.height() + 2)
        plate.moveBottomRight(frame.bottomRight() - QPoint(3, 3))
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(PLATE)
        painter.drawRoundedRect(plate, 4.0, 4.0)
        painter.setPen(Qt.GlobalColor.white)
        painter.drawText(plate, Qt.AlignmentFlag.AlignCenter, caption)
        state_icon(capture.state).paint(painter, frame.x() + 4, frame.y() + 4, 16, 16)
        painter.restore()


def thumbnail(path: Path) -> QPixmap:
    """Return a thumbnail of an image file, empty if the file cannot be read."""
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


VERDICT_MS = 3000
VERDICT_WIDTH = 320
EDGE = 8


class ImageArea(QWidget):
    """Image, result and film strip, with a message when the camera is lost."""

    def __init__(self) -> None:
        super().__init__()
        set_names(self, "calibrate.images", "Images of this step")
        self.view = LiveView()
        self.maps = MapsView()
        self.strip = FilmStrip()
        self.stack = QStackedWidget()
        self.stack.addWidget(self.view)
        self.stack.addWidget(self.maps)
        vbox(self._build_lost(), (self.stack, 1), self.strip, of=self, margins=0, spacing=0)
        self.result = self._floating("calibrate.result", "Result")
        self.result.setCheckable(True)
        self.result.toggled.connect(lambda on: self.stack.setCurrentIndex(int(on)))
        self.back_to_live = self._floating("calibrate.back_to_live", "Back to the live image")
        self.verdict = CaptureVerdictCard(self.view)
        self.stack.installEventFilter(self)

    def _floating(self, name: str, accessible: str) -> QToolButton:
        """Return a button at the top right corner of the image: it takes no space from it."""
        button = set_names(QToolButton(self), name, accessible)
        button.setText(accessible)
        return button

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Keep the floating buttons in their corner."""
        if event.type() in (QEvent.Type.Resize, QEvent.Type.Move, QEvent.Type.Show):
            self._place()
        return super().eventFilter(watched, event)

    def _place(self) -> None:
        right, top = self.stack.geometry().right() - EDGE, self.stack.y() + EDGE
        shown = [b for b in (self.result, self.back_to_live) if b.isVisibleTo(self)]
        widths = sum(button.sizeHint().width() + EDGE for button in shown)
        if right - widths < self.view.bar.geometry().right():
            top += self.view.bar.geometry().bottom()
        for button in shown:
            button.adjustSize()
            right -= button.width() + EDGE
            button.move(right + EDGE, top)
            button.raise_()
        self.verdict.place()

    def _build_lost(self) -> QWidget:
        self.lost = set_names(QWidget(), "calibrate.lost", "The camera is lost")
        self.why = named_label("calibrate.lost.why", "Why no image arrives", bold=1.0, role="fail")
        self.why.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Minimum)
        self.reconnect = QPushButton("Re&connect")
        set_names(self.reconnect, "calibrate.reconnect", "Open the camera again")
        hbox((self.why, 1), self.reconnect, of=self.lost, margins=(8, 4, 8, 4))
        self.lost.hide()
        return self.lost

    def show_page(self, page: PageState, before: PageState) -> None:
        """Show another state of the page: captures, the shown one, and images of the result."""
        if page.step is not before.step:
            self.verdict.hide()
            self.result.setChecked(False)
        self.lost.setVisible(bool(page.lost))
        self.why.setText(page.lost)
        self.strip.setVisible(bool(page.step.folder))
        if page.captures is not before.captures:
            self.strip.show_captures(page.captures)
        if page.panels is not before.panels:
            self.maps.show_panels(page.panels)
            if not page.panels:
                self.result.setChecked(False)
        self.result.setVisible(bool(page.panels))
        back = f"{page.shown}: back to live (Esc)"
        self.back_to_live.setText(back if page.shown else "")
        self.back_to_live.setVisible(bool(page.shown))
        if page.panels is not before.panels or page.shown != before.shown:
            self._place()

    def show_stream(self, stream: Stream | None) -> None:
        """Show the live image."""
        self.strip.choose("")
        self.view.set_overlay(None)
        self.view.set_stream(stream)
        self.view.image.show_message("Waiting for the first image of the camera.")

    def show_capture(self, name: str, rgb: PixelArray) -> None:
        """Show a capture instead of the live image."""
        self.view.set_stream(None)
        self.view.show_image(rgb)
        self.view.set_overlay(None)
        self.strip.choose(name)


class CaptureVerdictCard(QFrame):
    """A card over the image that says for a moment how a new capture was judged.

    Parameters
    ----------
    view : QWidget
        The image.
    """

    def __init__(self, view: QWidget) -> None:
        super().__init__(view)
        text = "Verdict on the new capture"
        set_names(self, "card", text)
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self._view, self._sign = view, StatusIcon()
        self.title = named_label("calibrate.verdict", text, wrap=False, bold=1.0)
        self._why = PlainLabel(wrap=True)
        head = hbox(self._sign, (self.title, 1), margins=0)
        vbox(head, self._why, of=self, margins=12, spacing=4)
        self.setFixedWidth(VERDICT_WIDTH)
        self._end = timer(self, VERDICT_MS, self.hide, once=True)
        self.hide()

    def show_capture(self, capture: Capture | None) -> None:
        """Show the verdict on a capture, or hide the card."""
        if capture is None or capture.finding is None:
            self.hide()
            return
        poor, value = not capture.used or capture.state != "pass", capture.residual
        value_text = capture.finding.value_text if value == value else state_word(capture.state)
        self.title.setText(f"{capture.path.stem}: {value_text}")
        self._why.setText(capture.finding.sentence if poor else "")
        self._why.setVisible(poor)
        self._sign.show_icon(state_icon(capture.state))
        set_background_role(self, capture.state)
        self.adjustSize()
        self.place()
        self.show()
        self.raise_()
        self._end.start()

    def place(self) -> None:
        """Stay in the middle of the lower edge of the image."""
        view_rect = self._view.rect()
        self.move((view_rect.width() - self.width()) // 2, view_rect.height() - self.height() - 48)
