"""The section line and the measured rectangle on the height map, with handles."""

from __future__ import annotations

import math

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QObject, QPointF, Signal
from PySide6.QtGui import QColor, QPolygonF
from PySide6.QtWidgets import QGraphicsPolygonItem

from app.view2d.map_view import MapView
from app.widgets.plots import own_handle_menus
from gelpolight_core.measurement.area import Rectangle

INK = "#ff5ac8"
REGION_INK = "#ff5c2e"
BAND = QColor(255, 90, 200, 60)
LEAST_MM = 0.05


class SectionLine(QObject):
    """A line with a width.

    Signals
    -------
    moved()
        Its ends have moved.
    """

    moved = Signal()

    def __init__(self, view: MapView) -> None:
        super().__init__(view)
        self._box = view.box
        self._roi = pg.LineSegmentROI(
            [[-6.0, 0.0], [6.0, 0.0]],
            pen=pg.mkPen(INK, width=2),
            hoverPen=pg.mkPen("#ffffff", width=2),
            handlePen=pg.mkPen(INK, width=2),
        )
        own_handle_menus(self._roi, view)
        self._roi.setZValue(30)
        self._band = QGraphicsPolygonItem()
        self._band.setBrush(BAND)
        self._band.setPen(pg.mkPen(None))
        self._band.setZValue(29)
        self._width_mm = 0.0
        for item in (self._band, self._roi):
            self._box.addItem(item, ignoreBounds=True)
            item.setVisible(False)
        self._roi.sigRegionChanged.connect(self._on_moved)

    @property
    def ends_mm(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Both ends (x, y)."""
        points = [self._roi.mapToParent(p) for p in self._roi.listPoints()]
        (start, end) = ((float(p.x()), float(p.y())) for p in points)
        if math.dist(start, end) < LEAST_MM:
            end = (start[0] + LEAST_MM, start[1])
        return start, end

    def set_width(self, width_mm: float) -> None:
        """Show the width that is averaged over."""
        self._width_mm = width_mm
        self._draw_band()

    def show(self, on: bool) -> None:
        """Show or hide it."""
        self._roi.setVisible(on)
        self._band.setVisible(on)

    def _on_moved(self) -> None:
        self._draw_band()
        self.moved.emit()

    def _draw_band(self) -> None:
        start, end = (np.array(p) for p in self.ends_mm)
        along = (end - start) / np.linalg.norm(end - start)
        across = 0.5 * self._width_mm * np.array([-along[1], along[0]])
        corners = (start + across, end + across, end - across, start - across)
        self._band.setPolygon(QPolygonF([QPointF(float(x), float(y)) for x, y in corners]))


class RegionBox(QObject):
    """A rectangle whose roughness is measured.

    Signals
    -------
    moved()
        The rectangle was moved or resized.
    """

    moved = Signal()

    def __init__(self, view: MapView) -> None:
        super().__init__(view)
        self._roi = pg.RectROI(
            [-2.0, -2.0],
            [4.0, 4.0],
            pen=pg.mkPen(REGION_INK, width=2),
            hoverPen=pg.mkPen("#ffffff", width=2),
            handlePen=pg.mkPen(REGION_INK, width=2),
        )
        own_handle_menus(self._roi, view)
        self._roi.setZValue(28)
        self._roi.setVisible(False)
        view.box.addItem(self._roi, ignoreBounds=True)
        self._roi.sigRegionChanged.connect(self.moved)

    @property
    def rectangle(self) -> Rectangle:
        """The rectangle in mm."""
        at, size = self._roi.pos(), self._roi.size()
        wide, high = (max(abs(float(v)), LEAST_MM) for v in (size.x(), size.y()))
        return Rectangle((float(at.x()) + 0.5 * wide, float(at.y()) + 0.5 * high), (wide, high))

    def show(self, on: bool) -> None:
        """Show or hide it."""
        self._roi.setVisible(on)
