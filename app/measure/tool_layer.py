"""Tools drawn over a map in mm: lines, figures, and the grips of the chosen one."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from typing import Any, Protocol

import pyqtgraph as pg
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QColor, QFontMetricsF, QPainter, QPen, QPolygonF, QTransform

from app.measure.grips import Grip, Point, nearest_grip

REACH_PX = 12.0
REACH_MM = 80.0
GRIP_PX = 5.0
HALO = QColor(0, 0, 0, 170)
PLATE = QColor(0, 0, 0, 165)
COLOURS = {"ok": "#e8eef5", "doubtful": "#ffd54a", "refused": "#ff6b5e", "chosen": "#5fd0ff"}


@dataclass(frozen=True, slots=True)
class DrawnTool:
    """One tool as it is shown.

    Attributes
    ----------
    key : int
        Its key on the sheet.
    lines : tuple of tuples of (x, y)
        In mm.
    state : str
        A key of COLOURS other than ``chosen``.
    text : str
        Its first figure.
    """

    key: int
    lines: tuple[tuple[Point, ...], ...]
    state: str = "ok"
    text: str = ""


class LayerUser(Protocol):
    """What the owner of the layer does."""

    def on_point(self, at_mm: Point) -> None:
        """Use a click on the map during placement."""

    def on_tool(self, key: int) -> None:
        """Choose a tool that was clicked."""

    def on_grip(self, name: str) -> None:
        """Choose a grip of the chosen tool."""

    def on_drag(self, name: str, to_mm: Point, *, ended: bool) -> None:
        """Move a grip of the chosen tool."""


class ToolLayer(pg.GraphicsObject):  # type: ignore[misc]
    """The tools; in mm, x right and y down.

    Parameters
    ----------
    user : LayerUser
        Called when the layer is clicked or dragged.
    """

    def __init__(self, user: LayerUser) -> None:
        super().__init__()
        self._user = user
        self.placing = False
        self._tools: tuple[DrawnTool, ...] = ()
        self._key = 0
        self._grips: tuple[Grip, ...] = ()
        self._grip = ""
        self._dragged = ""
        self._begun: tuple[Point, ...] = ()

    def show_tools(
        self, tools: tuple[DrawnTool, ...], key: int, grips: tuple[Grip, ...], grip: str
    ) -> None:
        """Show tools. `key` is the chosen one, with its grips; the keys move `grip`."""
        self._tools, self._key, self._grips, self._grip = tools, key, grips, grip
        self.update()

    def show_begun(self, clicked: tuple[Point, ...]) -> None:
        """Show the points clicked so far for a tool that needs more."""
        self._begun = clicked
        self.update()

    def boundingRect(self) -> QRectF:  # noqa: D102
        return QRectF(-REACH_MM, -REACH_MM, 2.0 * REACH_MM, 2.0 * REACH_MM)

    def hoverEvent(self, event: Any) -> None:  # noqa: D102
        if event.isExit():
            self.unsetCursor()
            return
        over = self._grip_at(event.pos())
        if self.placing:
            event.acceptClicks(Qt.MouseButton.LeftButton)
            self.setCursor(Qt.CursorShape.CrossCursor)
        elif over is not None:
            event.acceptClicks(Qt.MouseButton.LeftButton)
            event.acceptDrags(Qt.MouseButton.LeftButton)
            self.setCursor(Qt.CursorShape.SizeAllCursor)
        else:
            self.unsetCursor()

    def mouseClickEvent(self, event: Any) -> None:  # noqa: D102
        if event.button() != Qt.MouseButton.LeftButton or event.double():
            event.ignore()
            return
        at = (float(event.pos().x()), float(event.pos().y()))
        grip, tool = self._grip_at(event.pos()), self._tool_at(at)
        event.accept()
        if self.placing:
            self._user.on_point(at)
        elif grip is not None:
            self._user.on_grip(grip.name)
        elif tool:
            self._user.on_tool(tool)
        else:
            event.ignore()

    def mouseDragEvent(self, event: Any) -> None:  # noqa: D102
        if event.isStart():
            grip = None if self.placing else self._grip_at(event.buttonDownPos())
            if grip is None or event.button() != Qt.MouseButton.LeftButton:
                event.ignore()
                return
            self._dragged = grip.name
            self._user.on_grip(grip.name)
        if not self._dragged:
            event.ignore()
            return
        event.accept()
        name, at = self._dragged, (float(event.pos().x()), float(event.pos().y()))
        if event.isFinish():
            self._dragged = ""
        self._user.on_drag(name, at, ended=event.isFinish())

    def _reach_mm(self) -> float:
        return REACH_PX * float(self.pixelLength(pg.Point(1.0, 0.0)) or 0.01)

    def _grip_at(self, at: QPointF) -> Grip | None:
        return nearest_grip(self._grips, (at.x(), at.y()), reach_mm=self._reach_mm())

    def _tool_at(self, at: Point) -> int:
        """Return the key of the tool whose line passes a point, or 0."""
        reach = self._reach_mm()
        found = [
            (_distance(at, line), tool.key) for tool in self._tools for line in tool.lines if line
        ]
        near = min(found, default=(math.inf, 0))
        return near[1] if near[0] <= reach else 0

    # Painting

    def paint(self, painter: QPainter, *_: Any) -> None:  # noqa: D102
        to_screen = painter.worldTransform()
        painter.save()
        painter.resetTransform()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        for tool in self._tools:
            colour = QColor(COLOURS["chosen" if tool.key == self._key else tool.state])
            for line in tool.lines:
                _stroke(painter, to_screen.map(QPolygonF([QPointF(*p) for p in line])), colour)
        visible = to_screen.mapRect(QRectF(self.viewRect()))
        occupied: list[QRectF] = []
        for tool in self._tools:
            if tool.text:
                occupied.append(_paint_text(painter, tool, to_screen, visible, occupied))
        for grip in self._grips:
            self._paint_grip(painter, to_screen.map(QPointF(*grip.at_mm)), grip.name == self._grip)
        for point in self._begun:
            self._paint_grip(painter, to_screen.map(QPointF(*point)), False)
        painter.restore()

    @staticmethod
    def _paint_grip(painter: QPainter, at: QPointF, has_keys: bool) -> None:
        size = GRIP_PX + (2.0 if has_keys else 0.0)
        painter.setPen(QPen(QColor(0, 0, 0), 1.2))
        painter.setBrush(QColor("white") if has_keys else QColor(COLOURS["chosen"]))
        painter.drawRect(QRectF(at.x() - size, at.y() - size, 2.0 * size, 2.0 * size))


def _stroke(painter: QPainter, line: QPolygonF, colour: QColor) -> None:
    painter.setBrush(Qt.BrushStyle.NoBrush)
    for pen in (QPen(HALO, 3.8), QPen(colour, 1.8)):
        painter.setPen(pen)
        painter.drawPolyline(line)


def _paint_text(
    painter: QPainter, tool: DrawnTool, to_screen: QTransform, view: QRectF, occupied: list[QRectF]
) -> QRectF:
    """Write a tool's figure near its upper right, below earlier ones. Return its rectangle.

    `view` is the visible part of the map, on the screen.
    """
    points = [to_screen.map(QPointF(*p)) for line in tool.lines for p in line]
    metrics = QFontMetricsF(painter.font())
    width, height = metrics.horizontalAdvance(tool.text) + 10.0, metrics.height() + 4.0
    left = max((p.x() for p in points), default=0.0) + 10.0
    top = min((p.y() for p in points), default=0.0) - height
    left = max(min(left, view.right() - width), view.left())
    plate = QRectF(left, max(min(top, view.bottom() - height), view.top()), width, height)
    for other in sorted(occupied, key=lambda point: point.top()):
        if plate.intersects(other):
            plate.moveTop(other.bottom() + 2.0)
    painter.setPen(Qt.PenStyle.NoPen)
    painter.setBrush(PLATE)
    painter.drawRoundedRect(plate, 3.0, 3.0)
    painter.setPen(QColor(COLOURS[tool.state]))
    painter.drawText(plate, Qt.AlignmentFlag.AlignCenter, tool.text)
    return plate


def _distance(at: Point, line: tuple[Point, ...]) -> float:
    """Return the distance from a point to a polyline."""
    if len(line) == 1:
        return math.dist(at, line[0])
    return min(_to_part(at, a, b) for a, b in itertools.pairwise(line))


def _to_part(at: Point, a: Point, b: Point) -> float:
    dx, dy = b[0] - a[0], b[1] - a[1]
    length = dx * dx + dy * dy
    share = 0.0 if length == 0.0 else ((at[0] - a[0]) * dx + (at[1] - a[1]) * dy) / length
    share = min(max(share, 0.0), 1.0)
    return math.dist(at, (a[0] + share * dx, a[1] + share * dy))
