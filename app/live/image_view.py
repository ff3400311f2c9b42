"""One image in a pyqtgraph view: zoom, pan, fit, and the pointer position.

Coordinates are the core's: (u, v) with pixel centres at integers, v down.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import QRectF, Qt, QTimer, Signal
from PySide6.QtGui import QColor, QPainter, QResizeEvent

from app.views.map.map_view import FittedView
from app.widgets.widget_names import set_names

from .overlay import ImageOverlay
from .overlay_item import OverlayItem

# From this magnification on pixels are shown as squares, which is the purpose of zooming in.
SQUARES_FROM = 1.5
FLASH = QColor(255, 255, 255, 150)


class _DragViewBox(pg.ViewBox):  # type: ignore[misc]
    """A view box that passes on drags with the left button if requested."""

    def __init__(self) -> None:
        super().__init__(lockAspect=1.0, invertY=True, enableMenu=False)
        self.hands_drags_on = False
        self.on_dragged: Callable[[str, float, float], object]

    def mouseDragEvent(self, event: Any, axis: int | None = None) -> None:
        if not self.hands_drags_on or event.button() != Qt.MouseButton.LeftButton:
            super().mouseDragEvent(event, axis)
            return
        event.accept()
        if event.isStart():
            self._report("begin", event.buttonDownPos())
        self._report("end" if event.isFinish() else "move", event.pos())

    def _report(self, phase: str, at: Any) -> None:
        position = self.mapToView(at)
        self.on_dragged(phase, position.x(), position.y())


class ImageView(FittedView):
    """Shows an image and an overlay.

    Attributes
    ----------
    image_size : (width, height)
        Size of the image in pixels. (0, 0): no image.

    Signals
    -------
    clicked(float, float)
        A left click on the image.
    dragged(str, float, float)
        "begin", "move" or "end" of a drag with the left button, and its position; without
        :meth:`hand_drags_on` such a drag pans.
    zoomed(float)
        Screen pixels per image pixel; NaN without an image.
    resized()
        The size of the view changed.
    """

    clicked = Signal(float, float)
    dragged = Signal(str, float, float)
    zoomed = Signal(float)
    resized = Signal()

    def __init__(self) -> None:
        super().__init__(_DragViewBox())
        self.box.on_dragged = self.dragged.emit
        set_names(self, "live.image", "Live image")
        self.image_size = self._drawn = (0, 0)
        self.setCentralItem(self.box)
        self.overlay = OverlayItem()
        self.overlay.setZValue(10)
        self.box.addItem(self.overlay, ignoreBounds=True)
        self.box.sigRangeChanged.connect(self._on_range)
        self._words.setText("No camera. Select a source.")

    @property
    def scale_px(self) -> float:
        """Screen pixels per image pixel."""
        width, _ = self.box.viewPixelSize()
        return float(self.devicePixelRatioF() / width) if width > 0.0 else 1.0

    def show_rgb(
        self, rgb: NDArray[np.uint8] | None, *, size: tuple[int, int] | None = None
    ) -> None:
        """Show an image (rows, columns, 3), or none.

        A reduced image has the `size` (width, height) of its original; positions are pixels of the
        original.
        """
        self._words.setVisible(rgb is None)
        if rgb is None:
            self._image.clear()
            self.image_size = self._drawn = (0, 0)
            self._extent = QRectF()
            self.zoomed.emit(math.nan)
            return
        self._image.setImage(rgb, autoLevels=False)
        size = size or (rgb.shape[1], rgb.shape[0])
        drawn = (rgb.shape[1], rgb.shape[0])
        # Half a pixel: (0, 0) is the centre of the first pixel, not its corner.
        extent = QRectF(-0.5, -0.5, *size)
        if (drawn, size) != (self._drawn, self.image_size):
            self._drawn = drawn
            self._image.setRect(extent)
        if size != self.image_size:
            self.image_size = size
            # Far enough out for full size in any window, but the image must not get lost.
            self._show_extent(extent, beyond=max(4.0 * max(size), 8000.0), least=6.0)

    def show_overlay(self, overlay: ImageOverlay) -> None:
        """Draw an overlay on the image."""
        width, height = self.image_size
        self.overlay.set_overlay(overlay, (max(width, 1), max(height, 1)))

    def hand_drags_on(self, on: bool) -> None:
        """Emit drags with the left button instead of panning. The middle button still pans."""
        self.box.hands_drags_on = on

    def flash(self) -> None:
        """Brighten the view for a moment."""
        self.setForegroundBrush(FLASH)
        QTimer.singleShot(180, self, lambda: self.setForegroundBrush(Qt.BrushStyle.NoBrush))

    def show_message(self, text: str) -> None:
        """Change the text that is shown when there is no image."""
        self._words.setText(text)

    def full_size(self) -> None:
        """Show one image pixel on one screen pixel, keeping the centre of the view."""
        self._scale_to(1.0)

    def zoom_by(self, factor: float) -> None:
        """Magnify around the centre of the view."""
        self._scale_to(self.scale_px * factor)

    def _scale_to(self, scale: float) -> None:
        if self.image_size == (0, 0):
            return
        self._fitted = False
        centre = self.box.viewRect().center()
        width = self.box.width() * self.devicePixelRatioF() / scale
        height = self.box.height() * self.devicePixelRatioF() / scale
        self.box.setRange(
            QRectF(centre.x() - width / 2, centre.y() - height / 2, width, height), padding=0.0
        )

    def resizeEvent(self, event: QResizeEvent | None) -> None:  # noqa: D102
        self._scale_before = self.scale_px if hasattr(self, "_words") else 1.0
        super().resizeEvent(event)

    def _on_resized(self) -> None:
        if self._fitted:
            self.fit()
        else:
            self._scale_to(self._scale_before)
        self.resized.emit()

    def _on_range(self, *_: Any) -> None:
        self.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform, self.scale_px < SQUARES_FROM)
        self.zoomed.emit(self.scale_px if self.image_size != (0, 0) else math.nan)

    def _on_pointer(self, at: Any) -> None:
        position = self.box.mapSceneToView(at)
        self.pointed.emit(position.x(), position.y())

    def _on_click(self, event: Any) -> None:
        if event.button() != Qt.MouseButton.LeftButton:
            return
        if event.double():
            self.fit()
            return
        position = self.box.mapSceneToView(event.scenePos())
        self.clicked.emit(position.x(), position.y())
