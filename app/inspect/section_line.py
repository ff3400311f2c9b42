"""What is dragged on the height map: section lines, the measured rectangle, points of a plane."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QObject, QPointF, Qt, Signal
from PySide6.QtGui import QColor, QPolygonF
from PySide6.QtWidgets import QGraphicsPolygonItem

from app.view2d.cuts import Line, Point
from app.view2d.map_view import MapView
from app.view2d.profile_plot import LINE_COLOURS, line_colour
from app.widgets.plots import own_handle_menus
from gelpolight_core.measurement.area import Rectangle

REGION_INK = "#ff5c2e"
LEAST_MM = 0.05
APART_MM = 1.5
"""Distance of a new line from the chosen one."""


class SectionLines(QObject):
    """One or more lines on the map; the readings belong to the chosen one.

    Signals
    -------
    moved()
        The ends of a line have moved.
    changed()
        A line was added, removed or chosen.
    """

    moved = Signal()
    changed = Signal()

    def __init__(self, view: MapView) -> None:
        super().__init__(view)
        self._view = view
        self._lines: dict[int, _LineItem] = {}
        self._chosen = 1
        self._width_mm = 0.0
        self._on = False
        self._add(Line())

    def __iter__(self) -> Iterator[Line]:
        """Go through the lines, by their numbers."""
        return (self._lines[number].line for number in sorted(self._lines))

    @property
    def chosen(self) -> int:
        """Number of the chosen line."""
        return self._chosen

    @property
    def may_add(self) -> bool:
        """Whether there is a colour for one more line."""
        return len(self._lines) < len(LINE_COLOURS)

    @property
    def may_remove(self) -> bool:
        """Whether a line is left after removing one."""
        return len(self._lines) > 1

    def add(self) -> None:
        """Add a line beside the chosen one, and choose it."""
        if not self.may_add:
            return
        free = next(n for n in range(1, len(LINE_COLOURS) + 1) if n not in self._lines)
        beside = self._lines[self._chosen].line
        start, end = (np.array(p) for p in (beside.start_mm, beside.end_mm))
        along = (end - start) / np.linalg.norm(end - start)
        shift = APART_MM * np.array([-along[1], along[0]])
        self._add(Line(_point(start + shift), _point(end + shift), free))
        self.choose(free)

    def remove(self) -> None:
        """Remove the chosen line, and choose the one before it."""
        if not self.may_remove:
            return
        numbers = sorted(self._lines)
        at = numbers.index(self._chosen)
        self._lines.pop(self._chosen).discard()
        self.choose(numbers[at - 1] if at else numbers[1])

    def choose(self, number: int) -> None:
        """Choose a line for the readings."""
        self._chosen = number
        self._draw()
        self.changed.emit()

    def set_width(self, width_mm: float) -> None:
        """Show the width that is averaged over."""
        self._width_mm = width_mm
        self._draw()

    def show(self, on: bool) -> None:
        """Show or hide them."""
        self._on = on
        self._draw()

    def _add(self, line: Line) -> None:
        item = _LineItem(self._view, line)
        item.touched.connect(self._on_touched)
        item.moved.connect(self.moved)
        self._lines[line.number] = item

    def _draw(self) -> None:
        for number, item in self._lines.items():
            item.draw(self._width_mm, chosen=number == self._chosen, on=self._on)

    def _on_touched(self, number: int) -> None:
        if number != self._chosen:
            self.choose(number)


class _LineItem(QObject):
    """A line with its number and the band that is averaged over."""

    moved = Signal()
    touched = Signal(int)

    def __init__(self, view: MapView, line: Line) -> None:
        super().__init__(view)
        self._box, self._number = view.box, line.number
        self._width_mm = 0.0
        self._colour = line_colour(line.number)
        self._roi = pg.LineSegmentROI(
            [line.start_mm, line.end_mm],
            hoverPen=pg.mkPen("#ffffff", width=2),
            handlePen=pg.mkPen(self._colour, width=2),
        )
        own_handle_menus(self._roi, view)
        self._roi.setAcceptedMouseButtons(Qt.MouseButton.LeftButton)
        band = QColor(self._colour)
        band.setAlpha(60)
        self._band = QGraphicsPolygonItem()
        self._band.setBrush(band)
        self._band.setPen(pg.mkPen(None))
        self._label = pg.TextItem(str(line.number), color=self._colour, anchor=(1.2, 0.5))
        for level, item in enumerate((self._band, self._label, self._roi)):
            item.setZValue(28 + level)
            item.setVisible(False)
            self._box.addItem(item, ignoreBounds=True)
        self._roi.sigClicked.connect(lambda *_: self.touched.emit(self._number))
        self._roi.sigRegionChanged.connect(self._on_moved)

    @property
    def line(self) -> Line:
        """Both ends, and the number."""
        points = [self._roi.mapToParent(p) for p in self._roi.listPoints()]
        (start, end) = ((float(p.x()), float(p.y())) for p in points)
        if math.dist(start, end) < LEAST_MM:
            end = (start[0] + LEAST_MM, start[1])
        return Line(start, end, self._number)

    def draw(self, width_mm: float, *, chosen: bool, on: bool) -> None:
        """Show it with this width, thicker if it is the chosen one."""
        self._width_mm = width_mm
        self._roi.setPen(pg.mkPen(self._colour, width=3 if chosen else 1.5))
        for item in (self._band, self._label, self._roi):
            item.setVisible(on)
        self._lay_band()

    def discard(self) -> None:
        """Take it off the map."""
        for item in (self._band, self._label, self._roi):
            self._box.removeItem(item)
        for handle in self._roi.getHandles():
            handle.menu.deleteLater()
        self.deleteLater()

    def _on_moved(self) -> None:
        self._lay_band()
        self.touched.emit(self._number)
        self.moved.emit()

    def _lay_band(self) -> None:
        line = self.line
        start, end = (np.array(p) for p in (line.start_mm, line.end_mm))
        along = (end - start) / np.linalg.norm(end - start)
        across = 0.5 * self._width_mm * np.array([-along[1], along[0]])
        corners = (start + across, end + across, end - across, start - across)
        self._band.setPolygon(QPolygonF([QPointF(float(x), float(y)) for x, y in corners]))
        self._label.setPos(*line.start_mm)


def _point(at: np.ndarray) -> Point:
    return float(at[0]), float(at[1])


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
        self._roi.setZValue(27)
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
