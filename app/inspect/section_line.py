"""What is dragged on the height map: section line, measured rectangle, points of a plane."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from app.live.grips import corners_of, rectangle_grips, rectangle_moved
from app.live.tool_layer import DrawnTool
from app.view2d.cuts import Section
from app.view2d.handles import Handle, Point
from app.view2d.map_view import Extent
from app.view2d.profile_plot import LINE_INK
from gelpolight_core.measurement.area import Rectangle

REGION_INK, POINT_INK = "#ff5c2e", "#5ad7ff"
LEAST_MM = 0.05
REACH = 0.75
"""Distance of the first points from the middle of the map, of half its shorter side."""


class SectionMarks:
    """The section line on the map, a rectangle, and three points of a plane.

    A user of :class:`app.live.tool_layer.ToolLayer`.

    Parameters
    ----------
    on_moved : callable
        Called when something was dragged.

    Attributes
    ----------
    start_mm, end_mm : (x, y)
        Ends of the line.
    rectangle : Rectangle
        The measured rectangle.
    points_mm : tuple of (x, y)
        Three points.
    """

    def __init__(self, on_moved: Callable[[], object]) -> None:
        self._on_moved = on_moved
        self.start_mm, self.end_mm = Section().start_mm, Section().end_mm
        self.rectangle = Rectangle((0.0, 0.0), (4.0, 4.0))
        self.points_mm: tuple[Point, ...] = ()

    @property
    def _middle(self) -> Point:
        (x0, y0), (x1, y1) = self.start_mm, self.end_mm
        return 0.5 * (x0 + x1), 0.5 * (y0 + y1)

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
        self, *, line: bool, rectangle: bool, points: bool, width_mm: float
    ) -> tuple[tuple[DrawnTool, ...], tuple[Handle, ...]]:
        """Return what is drawn on the map, and the grips; the line shows the width of its mean."""
        tools, grips = list[DrawnTool](), list[Handle]()
        if line:
            ends = self.start_mm, self.end_mm
            band = (*self._shifted(0.5 * width_mm), *reversed(self._shifted(-0.5 * width_mm)))
            tools.append(DrawnTool(0, (ends,), LINE_INK, width=3.0, band=band))
            grips += [Handle("start", self.start_mm), Handle("middle", self._middle)]
            grips.append(Handle("end", self.end_mm))
        if rectangle:
            tools.append(DrawnTool(0, (corners_of(self.rectangle),), REGION_INK))
            grips += rectangle_grips(self.rectangle)
        if points:
            for number, at in enumerate(self.points_mm, start=1):
                tools.append(DrawnTool(0, ((at,),), POINT_INK, str(number)))
                grips.append(Handle(str(number), at))
        return tuple(tools), tuple(grips)

    def _shifted(self, by_mm: float) -> tuple[Point, Point]:
        """Return the ends of the line, moved across it."""
        (x0, y0), (x1, y1) = self.start_mm, self.end_mm
        length = math.dist(self.start_mm, self.end_mm)
        dx, dy = -by_mm * (y1 - y0) / length, by_mm * (x1 - x0) / length
        return (x0 + dx, y0 + dy), (x1 + dx, y1 + dy)

    # Called by the layer

    def on_point(self, at_mm: Point) -> None:
        """Do nothing: no tool is placed by clicks."""

    def on_tool(self, key: int) -> None:
        """Do nothing: there is nothing to choose."""

    def on_grip(self, name: str) -> None:
        """Do nothing: no grip is moved by keys."""

    def on_drag(self, name: str, to_mm: Point, *, ended: bool) -> None:
        """Move an end or the middle of the line, the rectangle or a point."""
        if name.isdigit():
            at = int(name) - 1
            self.points_mm = (*self.points_mm[:at], to_mm, *self.points_mm[at + 1 :])
        elif name == "start":
            self.start_mm = _apart(to_mm, self.end_mm)
        elif name == "end":
            self.end_mm = _apart(to_mm, self.start_mm)
        elif name == "middle":
            dx, dy = np.subtract(to_mm, self._middle).tolist()
            (x0, y0), (x1, y1) = self.start_mm, self.end_mm
            self.start_mm, self.end_mm = (x0 + dx, y0 + dy), (x1 + dx, y1 + dy)
        else:
            self.rectangle = rectangle_moved(self.rectangle, name, to_mm)
        self._on_moved()


def _apart(end_mm: Point, other_mm: Point) -> Point:
    """Return an end of a line that is not too near the other one."""
    near = math.dist(end_mm, other_mm) < LEAST_MM
    return (other_mm[0] + LEAST_MM, other_mm[1]) if near else end_mm
