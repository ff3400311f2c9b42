"""From clicks on the map to a tool: number and order of its points. Without Qt."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from gelpolight_core.measurement.tool import POINTS, places
from gelpolight_core.measurement.tools import TOOLS, Rectangle, Tool
from gelpolight_core.translation import tr

Point = tuple[float, float]
STEP_SIDE_MM = 0.8
LEAST_SIDE_MM = 0.1
FIRST_REACH_MM = 2.0
INDENTERS = ("ball", "cylinder", "cuboid")


@dataclass(frozen=True, slots=True)
class Kind:
    """One kind of tool.

    Attributes
    ----------
    name : str
        As in the core.
    label : str
        Name shown to the user.
    key : str
        The key that chooses it.
    asks : tuple of str
        Prompt for each click.
    group : str
        Tools of a group are together on the palette.
    """

    name: str
    label: str
    key: str
    asks: tuple[str, ...]
    group: str


def kinds() -> tuple[Kind, ...]:
    """Return the palette: the tools in its order."""
    on_it = tr("Click on the object")
    groups = {
        "lines": (
            ("distance", "D", tr("Distance"),
             tr("Click the first point"), tr("Click the second point")),
            ("step-height", "S", tr("Step height"),
             tr("Click the lower area"), tr("Click the area to compare with it")),
            ("profile-width", "W", tr("Profile width"),
             tr("Click the start of the section"), tr("Click the end of the section")),
            ("angle", "A", tr("Angle"), tr("Click the end of one arm"), tr("Click the apex"),
             tr("Click the end of the other arm")),
        ),
        "outlines": (
            ("circle", "C", tr("Circle"), tr("Click a point on the edge"),
             tr("Click a second point on the edge"), tr("Click a third point on the edge")),
            ("rectangle", "R", tr("Rectangle"),
             tr("Click one corner"), tr("Click the opposite corner")),
        ),
        "features": (
            ("pit", "I", tr("Pit or bump"), tr("Click one corner, beside the pit or bump"),
             tr("Click the opposite corner, on the other side")),
            ("scratch", "X", tr("Scratch"),
             tr("Click the surface on one side of the scratch"),
             tr("Click the surface on the other side")),
            ("edge-radius", "E", tr("Edge radius"), tr("Click where the rounding begins"),
             tr("Click across the edge, where the rounding ends")),
        ),
        "objects": (
            ("ball", "B", tr("Ball"), on_it),
            ("cylinder", "Y", tr("Cylinder"), on_it),
            ("cuboid", "U", tr("Cuboid"), on_it),
        ),
    }  # fmt: skip
    return tuple(
        Kind(name, label, key, tuple(asks), group)
        for group, rows in groups.items()
        for name, key, label, *asks in rows
    )


def kind_label(name: str) -> str:
    """Return the name of a kind of tool for the user."""
    return next((kind.label for kind in kinds() if kind.name == name), name)


def make_tool(name: str, points: Sequence[Point]) -> Tool:
    """Return the tool through the clicked points.

    The points are the places of the tool in the order of its fields. A tool with one rectangle gets
    two opposite corners; of more rectangles, the points are the centres.
    """
    made: Any = TOOLS[name]
    types = _types(name)
    if types == ["Rectangle"]:
        return cast(Tool, made(_rectangle(points)))
    if types == [POINTS]:
        return cast(Tool, made(tuple(points)))
    sides = (STEP_SIDE_MM, STEP_SIDE_MM)
    given = (
        Rectangle(point, sides) if kind == "Rectangle" else point
        for kind, point in zip(types, points, strict=True)
    )
    return cast(Tool, made(*given))


def first_points(name: str, middle_mm: Point) -> tuple[Point, ...]:
    """Return points for a tool that is placed with the keyboard, around the centre of the view."""
    x, y = middle_mm
    r = FIRST_REACH_MM
    if _types(name) == ["Rectangle"]:
        return (x - r, y - r), (x + r, y + r)
    (clicks,) = (len(kind.asks) for kind in kinds() if kind.name == name)
    if clicks == 1:
        return (middle_mm,)
    turns = np.linspace(-math.pi, 0.0, clicks)
    return tuple((x + r * math.cos(turn), y + r * math.sin(turn)) for turn in turns)


def _types(name: str) -> list[str]:
    """Return the types of the places of a tool."""
    return [str(field.type) for field in places(TOOLS[name])]


def _rectangle(corners: Sequence[Point]) -> Rectangle:
    """Return the rectangle between two opposite corners."""
    (x0, y0), (x1, y1) = corners
    sides = max(abs(x1 - x0), LEAST_SIDE_MM), max(abs(y1 - y0), LEAST_SIDE_MM)
    return Rectangle(((x0 + x1) / 2.0, (y0 + y1) / 2.0), sides)
