"""From clicks on a map to a tool."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, cast

import numpy as np

from gelpolight_core.measurement.area import Rectangle
from gelpolight_core.measurement.tools.tool_base import POINTS, Point, Tool, places
from gelpolight_core.measurement.tools.tool_registry import TOOLS, clicks

STEP_SIDE_MM = 0.8
LEAST_SIDE_MM = 0.1
FIRST_REACH_MM = 2.0


def _types(name: str) -> list[str]:
    """Return the types of the places of a tool."""
    return [str(field.type) for field in places(TOOLS[name])]


def make_tool(name: str, points: Sequence[Point]) -> Tool:
    """Return the tool through the clicked points.

    The points are the places of the tool in the order of its fields. A tool with one rectangle gets
    two opposite corners; of more rectangles, the points are the centres.
    """
    kind: Any = TOOLS[name]
    types = _types(name)
    if types == ["Rectangle"]:
        return cast(Tool, kind(_rectangle(points)))
    if types == [POINTS]:
        return cast(Tool, kind(tuple(points)))
    sides = (STEP_SIDE_MM, STEP_SIDE_MM)
    geometry = (
        Rectangle(point, sides) if field_type == "Rectangle" else point
        for field_type, point in zip(types, points, strict=True)
    )
    return cast(Tool, kind(*geometry))


def first_points(name: str, middle_mm: Point) -> tuple[Point, ...]:
    """Return points for a tool that is placed with the keyboard, around the centre of the view."""
    x, y = middle_mm
    r = FIRST_REACH_MM
    if _types(name) == ["Rectangle"]:
        return (x - r, y - r), (x + r, y + r)
    count = clicks(TOOLS[name])
    if count == 1:
        return (middle_mm,)
    angles_rad = np.linspace(-math.pi, 0.0, count)
    return tuple((x + r * math.cos(angle), y + r * math.sin(angle)) for angle in angles_rad)


def _rectangle(corners: Sequence[Point]) -> Rectangle:
    """Return the rectangle between two opposite corners."""
    (x0, y0), (x1, y1) = corners
    sides = max(abs(x1 - x0), LEAST_SIDE_MM), max(abs(y1 - y0), LEAST_SIDE_MM)
    return Rectangle(((x0 + x1) / 2.0, (y0 + y1) / 2.0), sides)
