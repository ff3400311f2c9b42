"""A map of the membrane in millimetres: zoom, pan, scale bar, and the cursor of all views."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QRectF, Qt, Signal
from PySide6.QtGui import QPainter, QResizeEvent
from PySide6.QtWidgets import QWidget

from app.inspect.scale_bar import ScaleBar
from app.live.picture_view import SURROUND
from app.widgets.label import PlainLabel
from app.widgets.naming import named

CURSOR = "#ffffff"
REACH_MM = 40.0


class MapView(pg.GraphicsView):  # type: ignore[misc]
    """Shows a picture over an extent in mm, x right and y down.

    Signals
    -------
    pointed(float, float)
        Place (x, y) under the pointer, mm; NaN where there is none.
    """

    pointed = Signal(float, float)

    def __init__(self, name: str, accessible: str, parent: QWidget | None = None) -> None:
        super().__init__(parent, background=SURROUND)
        named(self, name, accessible)
        self.setFocusPolicy(Qt.FocusPolicy.NoFocus)
        self.setMinimumSize(120, 100)
        self._extent = QRectF()
        self._fitted = True
        self.box = pg.ViewBox(lockAspect=1.0, invertY=True, enableMenu=False)
        self.box.disableAutoRange()
        self.setCentralItem(self.box)
        self._image = pg.ImageItem(axisOrder="row-major")
        self.box.addItem(self._image, ignoreBounds=True)
        pen = pg.mkPen(CURSOR, width=1, style=Qt.PenStyle.DashLine)
        self._lines = [pg.InfiniteLine(angle=angle, pen=pen) for angle in (90, 0)]
        for line in self._lines:
            line.setVisible(False)
            line.setZValue(20)
            self.box.addItem(line, ignoreBounds=True)
        self.box.sigRangeChangedManually.connect(self._on_moved_by_hand)
        self.box.sigRangeChanged.connect(self._on_range)
        self.scene().sigMouseMoved.connect(self._on_pointer)
        self.scene().sigMouseClicked.connect(self._on_click)
        self._scale = ScaleBar(self, f"{name}.scale")
        self._words = PlainLabel(parent=self)
        self._words.setAlignment(Qt.AlignmentFlag.AlignCenter)
        self._words.setWordWrap(True)
        self._words.setStyleSheet("color: #c4ccd4; background: transparent; font-size: 14px;")
        self._words.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.shown_pictures = 0

    def show_picture(self, rgb: NDArray[np.uint8], extent_mm: tuple[float, ...]) -> None:
        """Show a picture over (left, top, right, bottom)."""
        left, top, right, bottom = extent_mm
        extent = QRectF(left, top, right - left, bottom - top)
        self._words.hide()
        self._image.setImage(rgb, autoLevels=False)
        self.shown_pictures += 1
        if self._image.boundingRect().size() != extent.size() or extent != self._extent:
            self._image.setRect(extent)
        if extent != self._extent:
            self._extent = extent
            reach = REACH_MM + max(extent.width(), extent.height())
            self.box.setLimits(minXRange=0.2, xMin=-reach, xMax=reach, yMin=-reach, yMax=reach)
            self.fit()
        self._scale.setVisible(True)

    @property
    def has_picture(self) -> bool:
        """Whether a picture is shown, and no words."""
        return not self._extent.isNull()

    def say(self, text: str) -> None:
        """Show words in the place of a picture."""
        self._image.clear()
        self._extent = QRectF()
        self._scale.setVisible(False)
        self._words.setText(text)
        self._words.show()

    def fit(self) -> None:
        """Show all of it, and go on doing so when the view's size changes."""
        self._fitted = True
        if not self._extent.isEmpty():
            self.box.setRange(self._extent, padding=0.01)

    def show_cursor(self, x_mm: float, y_mm: float) -> None:
        """Mark a place; NaN: none."""
        there = math.isfinite(x_mm) and math.isfinite(y_mm)
        for line, value in zip(self._lines, (x_mm, y_mm), strict=True):
            line.setVisible(there)
            if there:
                line.setValue(value)

    def resizeEvent(self, event: QResizeEvent | None) -> None:  # noqa: D102
        super().resizeEvent(event)
        if not hasattr(self, "_words"):  # the base class resizes itself while being made
            return
        self._words.setGeometry(self.rect().adjusted(16, 16, -16, -16))
        if self._fitted:
            self.fit()
        self._on_range()

    def leaveEvent(self, event: QEvent) -> None:  # noqa: D102
        super().leaveEvent(event)
        self.pointed.emit(math.nan, math.nan)

    def _on_moved_by_hand(self, *_: Any) -> None:
        self._fitted = False

    def _on_range(self, *_: Any) -> None:
        width, _height = self.box.viewPixelSize()
        self.setRenderHint(QPainter.RenderHint.SmoothPixmapTransform, True)
        self._scale.follow(1.0 / width if width > 0.0 else 0.0, self.size())

    def _on_pointer(self, at: Any) -> None:
        place = self.box.mapSceneToView(at)
        inside = self._extent.contains(place.x(), place.y())
        self.pointed.emit(*((place.x(), place.y()) if inside else (math.nan, math.nan)))

    def _on_click(self, event: Any) -> None:
        if event.button() == Qt.MouseButton.LeftButton and event.double():
            self.fit()
