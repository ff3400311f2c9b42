"""From clicks on a map to a tool."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, cast

import numpy as np

from gelpolight_core.measurement.area import Rectangle

from .tool_base import POINTS, Point, Tool, geometry_fields

STEP_SIDE_MM = 0.8
LEAST_SIDE_MM = 0.1
FIRST_REACH_MM = 2.0


def _types(kind: type[Tool]) -> list[str]:
    """Return the types of the places of a tool."""
    return [str(field.type) for field in geometry_fields(kind)]


def clicks(kind: type[Tool]) -> int:
    """Return how many clicks place a tool: two for a rectangle alone, else one for each place."""
    types = _types(kind)
    if types == [POINTS]:
        return len(kind.palette.prompts) or 3
    return 2 if types == ["Rectangle"] else len(types)


def make_tool(kind: type[Tool], points: Sequence[Point]) -> Tool:
    """Return the tool through the clicked points.

    The points are the places of the tool in the order of its fields. A tool with one rectangle gets
    two opposite corners; of more rectangles, the points are the centres.
    """
    types, tool = _types(kind), cast(Any, kind)
    if types == ["Rectangle"]:
        return cast(Tool, tool(_rectangle(points)))
    if types == [POINTS]:
        return cast(Tool, tool(tuple(points)))
    sides = (STEP_SIDE_MM, STEP_SIDE_MM)
    geometry = (
        Rectangle(point, sides) if field_type == "Rectangle" else point
        for field_type, point in zip(types, points, strict=True)
    )
    return cast(Tool, tool(*geometry))


def first_points(kind: type[Tool], middle_mm: Point) -> tuple[Point, ...]:
    """Return points for a tool that is placed with the keyboard, around the centre of the view."""
    x, y = middle_mm
    r = FIRST_REACH_MM
    if _types(kind) == ["Rectangle"]:
        return (x - r, y - r), (x + r, y + r)
    count = clicks(kind)
    if count == 1:
        return (middle_mm,)
    angles_rad = np.linspace(-math.pi, 0.0, count)
    return tuple((x + r * math.cos(angle), y + r * math.sin(angle)) for angle in angles_rad)


def _rectangle(corners: Sequence[Point]) -> Rectangle:
    """Return the rectangle between two opposite corners."""
    (x0, y0), (x1, y1) = corners
    sides = max(abs(x1 - x0), LEAST_SIDE_MM), max(abs(y1 - y0), LEAST_SIDE_MM)
    return Rectangle(((x0 + x1) / 2.0, (y0 + y1) / 2.0), sides)
