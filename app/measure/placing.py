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


ASKS = {
    "distance": (tr("Click the first point"), tr("Click the second point")),
    "step-height": (tr("Click the lower area"), tr("Click the area to compare with it")),
    "profile-width": (tr("Click the start of the section"), tr("Click the end of the section")),
    "angle": (
        tr("Click the end of one arm"),
        tr("Click the apex"),
        tr("Click the end of the other arm"),
    ),
    "circle": (
        tr("Click a point on the edge"),
        tr("Click a second point on the edge"),
        tr("Click a third point on the edge"),
    ),
    "rectangle": (tr("Click one corner"), tr("Click the opposite corner")),
    "pit": (
        tr("Click one corner, beside the pit or bump"),
        tr("Click the opposite corner, on the other side"),
    ),
    "scratch": (
        tr("Click the surface on one side of the scratch"),
        tr("Click the surface on the other side"),
    ),
    "edge-radius": (
        tr("Click where the rounding begins"),
        tr("Click across the edge, where the rounding ends"),
    ),
}
"""Prompts of the tools that need more than one click on the object."""
KINDS = tuple(
    Kind(name, label, key, ASKS.get(name, (tr("Click on the object"),)), group)
    for group, name, key, label in (
        ("lines", "distance", "D", tr("Distance")),
        ("lines", "step-height", "S", tr("Step height")),
        ("lines", "profile-width", "W", tr("Profile width")),
        ("lines", "angle", "A", tr("Angle")),
        ("outlines", "circle", "C", tr("Circle")),
        ("outlines", "rectangle", "R", tr("Rectangle")),
        ("features", "pit", "I", tr("Pit or bump")),
        ("features", "scratch", "X", tr("Scratch")),
        ("features", "edge-radius", "E", tr("Edge radius")),
        ("objects", "ball", "B", tr("Ball")),
        ("objects", "cylinder", "Y", tr("Cylinder")),
        ("objects", "cuboid", "U", tr("Cuboid")),
    )
)
"""The tools in the order of the palette."""
BY_NAME = {kind.name: kind for kind in KINDS}


def kind_label(name: str) -> str:
    """Return the name of a kind of tool for the user."""
    return BY_NAME[name].label if name in BY_NAME else name


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
    clicks = len(BY_NAME[name].asks)
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
