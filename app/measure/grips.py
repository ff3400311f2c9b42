"""The grips of a tool, and the tool after a grip was moved. Without Qt."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

from gelpolight_core.measurement.tools import (
    Angle,
    Ball,
    Circle,
    Cuboid,
    Cylinder,
    Distance,
    EdgeRadius,
    Pit,
    ProfileWidth,
    Rectangle,
    RectangleTool,
    Scratch,
    StepHeight,
    Tool,
)

Point = tuple[float, float]
LEAST_SIDE_MM = 0.1
TURN_REACH = 0.35
"""Distance of a rectangle's rotation grip from the middle of its first side's end."""


@dataclass(frozen=True, slots=True)
class Grip:
    """A point of a tool that can be moved.

    Attributes
    ----------
    name : str
        Name of the grip within the tool.
    at_mm : (float, float)
        Position (x, y).
    """

    name: str
    at_mm: Point


def grips_of(tool: Tool) -> tuple[Grip, ...]:
    """Return the grips of a tool in the order of the keyboard selection."""
    match tool:
        case Distance():
            return Grip("a", tool.a_mm), Grip("b", tool.b_mm)
        case ProfileWidth() | Scratch() | EdgeRadius():
            return Grip("start", tool.start_mm), Grip("end", tool.end_mm)
        case Angle():
            return (
                Grip("first", tool.first_mm),
                Grip("apex", tool.apex_mm),
                Grip("second", tool.second_mm),
            )
        case Circle():
            return tuple(Grip(str(i), point) for i, point in enumerate(tool.points_mm))
        case RectangleTool() | Pit():
            return _of_rectangle(tool.rectangle, "")
        case StepHeight():
            return (*_of_rectangle(tool.first, "first."), *_of_rectangle(tool.second, "second."))
        case Ball() | Cylinder() | Cuboid():
            return () if tool.at_mm is None else (Grip("at", tool.at_mm),)
    raise TypeError(f"{tool.name} has no grips")


def moved(tool: Tool, grip: str, to_mm: Point) -> Tool:
    """Return a tool with one of its grips moved."""
    match tool:
        case Distance() | ProfileWidth() | Scratch() | EdgeRadius() | Angle():
            return replace(tool, **{f"{grip}_mm": to_mm})
        case Circle():
            points = list(tool.points_mm)
            points[int(grip)] = to_mm
            return replace(tool, points_mm=tuple(points))
        case RectangleTool() | Pit():
            return replace(tool, rectangle=_rectangle_moved(tool.rectangle, grip, to_mm))
        case StepHeight():
            which, _, part = grip.partition(".")
            return replace(tool, **{which: _rectangle_moved(getattr(tool, which), part, to_mm)})
        case Ball() | Cylinder() | Cuboid():
            return replace(tool, at_mm=to_mm)
    raise TypeError(f"{tool.name} has no grips")


def outline_of(tool: Tool) -> tuple[tuple[Point, ...], ...]:
    """Return the lines of a tool as it was placed, before anything is measured."""
    match tool:
        case Distance():
            return ((tool.a_mm, tool.b_mm),)
        case ProfileWidth() | Scratch() | EdgeRadius():
            return ((tool.start_mm, tool.end_mm),)
        case Angle():
            return ((tool.first_mm, tool.apex_mm, tool.second_mm),)
        case RectangleTool() | Pit():
            return (_corners(tool.rectangle),)
        case StepHeight():
            return _corners(tool.first), _corners(tool.second)
    return ()


def nearest_grip(grips: tuple[Grip, ...], at_mm: Point, *, reach_mm: float) -> Grip | None:
    """Return the grip nearest to a point. None if all are out of reach."""
    near = min(grips, key=lambda g: math.dist(g.at_mm, at_mm), default=None)
    return near if near is not None and math.dist(near.at_mm, at_mm) <= reach_mm else None


def _of_rectangle(area: Rectangle, prefix: str) -> tuple[Grip, ...]:
    a, b = 0.5 * area.sides_mm[0], 0.5 * area.sides_mm[1]
    return (
        Grip(f"{prefix}centre", area.centre_mm),
        Grip(f"{prefix}corner", _point(area, a, b)),
        Grip(f"{prefix}turn", _point(area, a + TURN_REACH, 0.0)),
    )


def _rectangle_moved(area: Rectangle, grip: str, to_mm: Point) -> Rectangle:
    x, y = to_mm[0] - area.centre_mm[0], to_mm[1] - area.centre_mm[1]
    if grip == "centre":
        return replace(area, centre_mm=to_mm)
    if grip == "turn":
        return replace(area, yaw_deg=math.degrees(math.atan2(y, x)))
    cos, sin = math.cos(math.radians(area.yaw_deg)), math.sin(math.radians(area.yaw_deg))
    along, across = abs(cos * x + sin * y), abs(cos * y - sin * x)
    sides = max(2.0 * along, LEAST_SIDE_MM), max(2.0 * across, LEAST_SIDE_MM)
    return replace(area, sides_mm=sides)


def _point(area: Rectangle, along: float, across: float) -> Point:
    cos, sin = math.cos(math.radians(area.yaw_deg)), math.sin(math.radians(area.yaw_deg))
    x, y = area.centre_mm
    return x + cos * along - sin * across, y + sin * along + cos * across


def _corners(area: Rectangle) -> tuple[Point, ...]:
    return tuple((float(x), float(y)) for x, y in area.outline_mm)
