"""What is dragged on the height map: section lines, the measured rectangle, points of a plane."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from app.live.grips import Grip, rectangle_grips, rectangle_moved
from app.live.tool_layer import DrawnTool
from app.view2d.cuts import Line, Point
from app.view2d.map_view import Extent
from app.view2d.profile_plot import LINE_COLOURS, line_colour
from gelpolight_core.measurement.area import Rectangle

REGION_INK, POINT_INK = "#ff5c2e", "#5ad7ff"
LEAST_MM = 0.05
APART_MM = 1.5
"""Distance of a new line from the chosen one."""
REACH = 0.75
"""Distance of the first points from the middle of the map, of half its shorter side."""


class SectionMarks:
    """One or more lines on the map, a rectangle, and three points of a plane.

    The readings belong to the chosen line. A user of :class:`app.live.tool_layer.ToolLayer`.

    Parameters
    ----------
    on_chosen, on_moved : callable
        Called when a line was added, removed or chosen, and when something was dragged.

    Attributes
    ----------
    lines : dict of int to Line
        By their numbers.
    chosen : int
        Number of the chosen line.
    rectangle : Rectangle
        The measured rectangle.
    points_mm : tuple of (x, y)
        Three points.
    """

    def __init__(self, on_chosen: Callable[[], object], on_moved: Callable[[], object]) -> None:
        self._on_chosen, self._on_moved = on_chosen, on_moved
        self.lines = {1: Line()}
        self.chosen = 1
        self.rectangle = Rectangle((0.0, 0.0), (4.0, 4.0))
        self.points_mm: tuple[Point, ...] = ()

    @property
    def may_add(self) -> bool:
        """Whether there is a colour for one more line."""
        return len(self.lines) < len(LINE_COLOURS)

    @property
    def may_remove(self) -> bool:
        """Whether a line is left after removing one."""
        return len(self.lines) > 1

    def add(self) -> None:
        """Add a line beside the chosen one, and choose it."""
        if not self.may_add:
            return
        free = next(n for n in range(1, len(LINE_COLOURS) + 1) if n not in self.lines)
        beside = self.lines[self.chosen]
        new = Line(*_shifted(beside, APART_MM), free)
        self.lines = dict(sorted({**self.lines, free: new}.items()))
        self.on_tool(free)

    def remove(self) -> None:
        """Remove the chosen line, and choose the one before it."""
        if self.may_remove:
            before = [number for number in self.lines if number < self.chosen]
            del self.lines[self.chosen]
            self.on_tool(max(before, default=min(self.lines)))

    def spread(self, extent: Extent) -> None:
        """Place the points around the middle of the first map."""
        if self.points_mm:
            return
        left, top, right, bottom = extent
        reach = 0.5 * REACH * min(right - left, bottom - top)
        turns = np.radians([210.0, 330.0, 90.0])
        x = 0.5 * (left + right) + reach * np.cos(turns)
        y = 0.5 * (top + bottom) + reach * np.sin(turns)
        self.points_mm = tuple(zip(x.tolist(), y.tolist(), strict=True))

    def drawn(
        self, *, lines: bool, rectangle: bool, points: bool, width_mm: float
    ) -> tuple[tuple[DrawnTool, ...], tuple[Grip, ...]]:
        """Return what is drawn on the map, and the grips; a line shows the width of its mean."""
        tools, grips = list[DrawnTool](), list[Grip]()
        if lines:
            tools += [self._drawn_line(line, width_mm) for line in self.lines.values()]
            line = self.lines[self.chosen]
            grips += [Grip("start", line.start_mm), Grip("middle", _middle(line))]
            grips.append(Grip("end", line.end_mm))
        if rectangle:
            corners = tuple((float(x), float(y)) for x, y in self.rectangle.outline_mm)
            tools.append(DrawnTool(0, (corners,), REGION_INK))
            grips += rectangle_grips(self.rectangle)
        if points:
            for number, at in enumerate(self.points_mm, start=1):
                tools.append(DrawnTool(0, ((at,),), POINT_INK, str(number)))
                grips.append(Grip(str(number), at))
        return tuple(tools), tuple(grips)

    def _drawn_line(self, line: Line, width_mm: float) -> DrawnTool:
        first, second = (_shifted(line, half) for half in (0.5 * width_mm, -0.5 * width_mm))
        return DrawnTool(
            line.number,
            ((line.start_mm, line.end_mm),),
            line_colour(line.number),
            str(line.number),
            width=3.0 if line.number == self.chosen else 1.5,
            band=(*first, *reversed(second)),
        )

    # Called by the layer

    def on_point(self, at_mm: Point) -> None:
        """Do nothing: no tool is placed by clicks."""

    def on_tool(self, key: int) -> None:
        """Choose a line for the readings."""
        self.chosen = key
        self._on_chosen()

    def on_grip(self, name: str) -> None:
        """Do nothing: no grip is moved by keys."""

    def on_drag(self, name: str, to_mm: Point, *, ended: bool) -> None:
        """Move an end or the middle of the chosen line, the rectangle or a point."""
        line = self.lines[self.chosen]
        if name.isdigit():
            at = int(name) - 1
            self.points_mm = (*self.points_mm[:at], to_mm, *self.points_mm[at + 1 :])
        elif name in ("start", "middle", "end"):
            self.lines[self.chosen] = _line_moved(line, name, to_mm)
        else:
            self.rectangle = rectangle_moved(self.rectangle, name, to_mm)
        self._on_moved()


def _middle(line: Line) -> Point:
    (x0, y0), (x1, y1) = line.start_mm, line.end_mm
    return 0.5 * (x0 + x1), 0.5 * (y0 + y1)


def _line_moved(line: Line, grip: str, to_mm: Point) -> Line:
    """Return a line with an end moved, or all of it by its middle."""
    if grip == "middle":
        dx, dy = np.subtract(to_mm, _middle(line)).tolist()
        (x0, y0), (x1, y1) = line.start_mm, line.end_mm
        return replace(line, start_mm=(x0 + dx, y0 + dy), end_mm=(x1 + dx, y1 + dy))
    other = line.end_mm if grip == "start" else line.start_mm
    if math.dist(to_mm, other) < LEAST_MM:
        to_mm = (other[0] + LEAST_MM, other[1])
    return replace(line, start_mm=to_mm) if grip == "start" else replace(line, end_mm=to_mm)


def _shifted(line: Line, by_mm: float) -> tuple[Point, Point]:
    """Return the ends of a line, moved across it."""
    (x0, y0), (x1, y1) = line.start_mm, line.end_mm
    length = math.dist(line.start_mm, line.end_mm)
    dx, dy = -by_mm * (y1 - y0) / length, by_mm * (x1 - x0) / length
    return (x0 + dx, y0 + dy), (x1 + dx, y1 + dy)
