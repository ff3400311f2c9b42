"""Tools and lines drawn over a map in mm: lines, figures, and the handles that can be dragged."""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Protocol, cast

import numpy as np
from PySide6.QtCore import QPointF, QRectF, Qt
from PySide6.QtGui import QFontMetricsF, QGuiApplication, QPainter, QPolygonF, QTransform

from app.views.map.handles import LEFT, REACH_PX, Handle, HandleItem
from gelpolight_core.base.arrays import PointXY
from gelpolight_core.measurement.area import Rectangle
from gelpolight_core.measurement.tools.tool_base import POINTS, Tool, geometry_fields

from .overlay_item import ROLE_COLOURS, colour_of, paint_grip, paint_plate, stroke

LEAST_SIDE_MM = 0.1
RECTANGLE_GRIPS = ("centre", "corner", "turn")
TURN_REACH = 0.35
"""Distance of a rectangle's rotation grip from the middle of its first side's end."""


def tool_handles(tool: Tool) -> tuple[Handle, ...]:
    """Return the grips of a tool in the order of the keyboard selection."""
    handles: list[Handle] = []
    areas = _areas(tool)
    for field in geometry_fields(type(tool)):
        value = getattr(tool, field.name)
        if isinstance(value, Rectangle):
            handles += rectangle_grips(value, f"{field.name}." if len(areas) > 1 else "")
        elif str(field.type) == POINTS:
            handles += [Handle(str(i), point) for i, point in enumerate(value)]
        elif value is not None:
            handles.append(Handle(field.name.removesuffix("_mm"), value))
    return tuple(handles)


def move_handle(tool: Tool, grip: str, to_mm: PointXY) -> Tool:
    """Return a tool with one of its grips moved."""
    changed: Any = tool
    area, _, part = grip.rpartition(".")
    if part in RECTANGLE_GRIPS:
        name = area or next(iter(_areas(tool)))
        return cast(
            Tool, replace(changed, **{name: rectangle_moved(_areas(tool)[name], part, to_mm)})
        )
    if grip.isdigit():
        (field,) = geometry_fields(type(tool))
        points = list(getattr(tool, field.name))
        points[int(grip)] = to_mm
        return cast(Tool, replace(changed, **{field.name: tuple(points)}))
    return cast(Tool, replace(changed, **{f"{grip}_mm": to_mm}))


def outline_of(tool: Tool) -> tuple[tuple[PointXY, ...], ...]:
    """Return the lines of a tool as it was placed, before anything is measured."""
    if areas := _areas(tool):
        return tuple(corners_of(area) for area in areas.values())
    ends = [getattr(tool, f.name) for f in geometry_fields(type(tool)) if str(f.type) == "Point"]
    return (tuple(ends),) if len(ends) > 1 else ()


def _areas(tool: Tool) -> dict[str, Rectangle]:
    """Return the rectangles of a tool by the names of their fields."""
    values = {field.name: getattr(tool, field.name) for field in geometry_fields(type(tool))}
    return {name: value for name, value in values.items() if isinstance(value, Rectangle)}


def rectangle_grips(area: Rectangle, prefix: str = "") -> tuple[Handle, ...]:
    """Return the grips of a rectangle: its middle, a corner, and one that turns it."""
    a, b = 0.5 * area.sides_mm[0], 0.5 * area.sides_mm[1]
    (x, y), (turn_x, turn_y) = area.place(
        np.array([a, a + TURN_REACH]), np.array([b, 0.0])
    ).tolist()
    return (
        Handle(f"{prefix}centre", area.centre_mm),
        Handle(f"{prefix}corner", (x, y)),
        Handle(f"{prefix}turn", (turn_x, turn_y)),
    )


def rectangle_moved(area: Rectangle, grip: str, to_mm: PointXY) -> Rectangle:
    """Return a rectangle with one of its grips moved."""
    if grip == "centre":
        return replace(area, centre_mm=to_mm)
    if grip == "turn":
        x, y = to_mm[0] - area.centre_mm[0], to_mm[1] - area.centre_mm[1]
        return replace(area, yaw_deg=math.degrees(math.atan2(y, x)))
    along, across = (abs(float(side)) for side in area.from_centre(*np.array(to_mm)))
    sides = max(2.0 * along, LEAST_SIDE_MM), max(2.0 * across, LEAST_SIDE_MM)
    return replace(area, sides_mm=sides)


def corners_of(area: Rectangle) -> tuple[PointXY, ...]:
    """Return the outline of a rectangle."""
    return tuple((float(x), float(y)) for x, y in area.outline_mm)


BAND_ALPHA = 60
MEASURED, CHOSEN = ROLE_COLOURS["info"], "#5fd0ff"


@dataclass(frozen=True, slots=True)
class DrawnTool:
    """One tool as it is shown on the map, in 3D and in the camera image.

    Attributes
    ----------
    key : int
        Its key, which tells what was clicked.
    lines : tuple of tuples of (x, y)
        In mm. A single point is only the place of the text.
    role : str
        Role of its lines, or their colour.
    text : str
        Its first figure.
    text_role : str
        Role of the text. Empty: that of the lines.
    width : float
        Width of the lines in pixels.
    band : tuple of (x, y)
        Corners of an area that is tinted.
    """

    key: int
    lines: tuple[tuple[PointXY, ...], ...]
    role: str = MEASURED
    text: str = ""
    text_role: str = ""
    width: float = 1.8
    band: tuple[PointXY, ...] = ()


class ToolLayerOwner(Protocol):
    """What the owner of the layer does."""

    def on_point(self, at_mm: PointXY) -> None:
        """Use a click on the map during placement."""

    def on_tool(self, key: int) -> None:
        """Choose a tool that was clicked."""

    def on_grip(self, name: str) -> None:
        """Choose a handle of the chosen tool."""

    def on_drag(self, name: str, to_mm: PointXY, *, ended: bool) -> None:
        """Move a handle of the chosen tool."""


class ToolLayer(HandleItem):
    """Draws the tools, in mm, x right and y down.

    Parameters
    ----------
    user : ToolLayerOwner
        Called when the layer is clicked or dragged.
    """

    def __init__(self, user: ToolLayerOwner) -> None:
        super().__init__()
        self._user = user
        self.placing = False
        self.tools: tuple[DrawnTool, ...] = ()
        self._begun: tuple[PointXY, ...] = ()
        self._towards: tuple[PointXY, ...] = ()

    def show_tools(
        self, tools: tuple[DrawnTool, ...], grips: tuple[Handle, ...], grip: str = ""
    ) -> None:
        """Show tools, and handles that can be dragged. The keys move the one named `grip`."""
        self.tools, self.handles = tools, grips
        self.select(grip)

    def show_begun(self, clicked: tuple[PointXY, ...]) -> None:
        """Show the points clicked so far for a tool that needs more."""
        self._begun, self._towards = clicked, ()
        self.update()

    def on_grab(self, handle: Handle) -> None:
        """Choose a handle."""
        self._user.on_grip(handle.name)

    def on_drag(self, handle: Handle, *, ended: bool) -> None:
        """Move a handle."""
        self._user.on_drag(handle.name, handle.at, ended=ended)

    def _cursor_at(self, at: QPointF) -> Qt.CursorShape | None:
        return Qt.CursorShape.CrossCursor if self.placing else super()._cursor_at(at)

    def mouseDragEvent(self, event: Any) -> None:  # noqa: D102
        if self.placing and event.button() == LEFT:
            event.accept()
            self._draw(event)
        else:
            super().mouseDragEvent(event)

    def _draw(self, event: Any) -> None:
        """Place two points of a tool by a drag: one at its start, one at its end."""
        down, now, ended = event.buttonDownPos(), event.pos(), event.isFinish()
        if event.isStart():
            self._user.on_point((down.x(), down.y()))
        way = self.mapToScene(now) - self.mapToScene(down)
        drawn = (
            self.placing
            and way.manhattanLength() >= QGuiApplication.styleHints().startDragDistance()
        )
        self._towards = ((now.x(), now.y()),) if drawn and not ended else ()
        self.update()
        if drawn and ended:
            self._user.on_point((now.x(), now.y()))

    def mouseClickEvent(self, event: Any) -> None:  # noqa: D102
        if event.button() != LEFT or event.double():
            event.ignore()
            return
        at = (float(event.pos().x()), float(event.pos().y()))
        if self.placing:
            event.accept()
            self._user.on_point(at)
            return
        super().mouseClickEvent(event)
        if not event.isAccepted() and (tool := self._tool_at(at)):
            event.accept()
            self._user.on_tool(tool)

    def _tool_at(self, at: PointXY) -> int:
        """Return the key of the tool whose line passes a point, or 0."""
        reach_mm = REACH_PX * (self.pixelWidth() or 0.01)
        distances = [
            (_distance(at, line), tool.key) for tool in self.tools for line in tool.lines if line
        ]
        near = min(distances, default=(math.inf, 0))
        return near[1] if near[0] <= reach_mm else 0

    # Painting

    def paint(self, painter: QPainter, *_: Any) -> None:  # noqa: D102
        to_screen = painter.worldTransform()
        painter.save()
        painter.resetTransform()
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        begun = DrawnTool(0, ((*self._begun, *self._towards),), CHOSEN)
        for tool in (*self.tools, begun):
            self._paint_lines(painter, tool, to_screen)
        visible = to_screen.mapRect(QRectF(self.viewRect()))
        occupied: list[QRectF] = []
        for tool in self.tools:
            if tool.text:
                occupied.append(_paint_text(painter, tool, to_screen, visible, occupied))
        for grip in self.handles:
            at = to_screen.map(QPointF(*grip.at))
            paint_grip(painter, at, CHOSEN, grip.name == self.selected)
        for point in (*self._begun, *self._towards):
            paint_grip(painter, to_screen.map(QPointF(*point)), CHOSEN, False)
        painter.restore()

    @staticmethod
    def _paint_lines(painter: QPainter, tool: DrawnTool, to_screen: QTransform) -> None:
        if tool.band:
            tint = colour_of(tool.role)
            tint.setAlpha(BAND_ALPHA)
            painter.setPen(Qt.PenStyle.NoPen)
            painter.setBrush(tint)
            painter.drawPolygon(_on_screen(tool.band, to_screen))
        for line in tool.lines:
            shape = _on_screen(line, to_screen)
            stroke(painter, tool.role, partial(painter.drawPolyline, shape), width=tool.width)


def _on_screen(points: tuple[PointXY, ...], to_screen: QTransform) -> QPolygonF:
    return to_screen.map(QPolygonF([QPointF(*point) for point in points]))


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
    paint_plate(painter, plate, tool.text, tool.text_role or tool.role)
    return plate


def _distance(at: PointXY, line: tuple[PointXY, ...]) -> float:
    """Return the distance from a point to a polyline."""
    if len(line) == 1:
        return math.dist(at, line[0])
    return min(_to_part(at, a, b) for a, b in itertools.pairwise(line))


def _to_part(at: PointXY, a: PointXY, b: PointXY) -> float:
    dx, dy = b[0] - a[0], b[1] - a[1]
    length = dx * dx + dy * dy
    share = 0.0 if length == 0.0 else ((at[0] - a[0]) * dx + (at[1] - a[1]) * dy) / length
    share = min(max(share, 0.0), 1.0)
    return math.dist(at, (a[0] + share * dx, a[1] + share * dy))
