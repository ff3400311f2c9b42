"""The handles of a tool, and the tool after one was moved."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any, cast

import numpy as np

from app.views.map.handles import Handle
from gelpolight_core.base.arrays import PointXY
from gelpolight_core.measurement.area import Rectangle
from gelpolight_core.measurement.tools.tool_base import POINTS, Tool, geometry_fields

LEAST_SIDE_MM = 0.1
RECTANGLE_GRIPS = ("centre", "corner", "turn")
TURN_REACH = 0.35
"""Distance of a rectangle's rotation handle from the middle of its first side's end."""


def tool_handles(tool: Tool) -> tuple[Handle, ...]:
    """Return the handles of a tool in the order of the keyboard selection."""
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
    """Return a tool with one of its handles moved."""
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
    """Return the handles of a rectangle: its middle, a corner, and one that turns it."""
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
    """Return a rectangle with one of its handles moved."""
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
