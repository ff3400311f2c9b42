"""The three points of a levelling on the height map, to be dragged."""

from __future__ import annotations

import math

import pyqtgraph as pg
from PySide6.QtCore import QObject, Signal

from app.view2d.map_view import MapView

INK = "#5ad7ff"
REACH = 0.75
"""Distance of the first places from the middle of the map, of half its shorter side."""


class LevelPoints(QObject):
    """Three numbered points.

    Signals
    -------
    moved()
        A point was moved.
    """

    moved = Signal()

    def __init__(self, view: MapView) -> None:
        super().__init__(view)
        self._points = []
        self._placed = False
        for number in (1, 2, 3):
            point = pg.TargetItem(
                size=14, pen=pg.mkPen(INK, width=2), hoverPen=pg.mkPen("#ffffff", width=2),
                label=str(number), labelOpts={"color": INK, "offset": (8, -8)},
            )  # fmt: skip
            point.setZValue(31)
            point.setVisible(False)
            view.box.addItem(point, ignoreBounds=True)
            point.sigPositionChanged.connect(self.moved)
            self._points.append(point)

    @property
    def points_mm(self) -> tuple[tuple[float, float], ...]:
        """The points (x, y)."""
        return tuple((float(p.pos().x()), float(p.pos().y())) for p in self._points)

    def spread(self, extent_mm: tuple[float, float, float, float]) -> None:
        """Place them around the middle of the first map: left, top, right, bottom."""
        if self._placed:
            return
        self._placed = True
        left, top, right, bottom = extent_mm
        reach = 0.5 * REACH * min(right - left, bottom - top)
        for point, degrees in zip(self._points, (210.0, 330.0, 90.0), strict=True):
            angle = math.radians(degrees)
            x = 0.5 * (left + right) + reach * math.cos(angle)
            point.setPos(x, 0.5 * (top + bottom) + reach * math.sin(angle))

    def show(self, on: bool) -> None:
        """Show or hide them."""
        for point in self._points:
            point.setVisible(on)
