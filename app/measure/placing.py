"""From clicks on the map to a tool: number and order of its points. Without Qt."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from gelpolight_core.measurement.tool import POINTS, places
from gelpolight_core.measurement.tools import EXTENSIONS, TOOLS, Rectangle, Tool

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
        The key that chooses it; empty for none.
    asks : tuple of str
        Prompt for each click.
    group : str
        Tools of a group are together on the palette.
    icon : str
        Name of its icon.
    """

    name: str
    label: str
    key: str
    asks: tuple[str, ...]
    group: str
    icon: str


ASKS = {
    "distance": ("Click the first point", "Click the second point"),
    "step-height": ("Click the lower area", "Click the area to compare with it"),
    "profile-width": ("Click the start of the section", "Click the end of the section"),
    "angle": (
        "Click the end of one arm",
        "Click the apex",
        "Click the end of the other arm",
    ),
    "circle": (
        "Click a point on the edge",
        "Click a second point on the edge",
        "Click a third point on the edge",
    ),
    "rectangle": ("Click one corner", "Click the opposite corner"),
    "pit": (
        "Click one corner, beside the pit or bump",
        "Click the opposite corner, on the other side",
    ),
    "scratch": (
        "Click the surface on one side of the scratch",
        "Click the surface on the other side",
    ),
    "edge-radius": (
        "Click where the rounding begins",
        "Click across the edge, where the rounding ends",
    ),
}
"""Prompts of the tools that need more than one click on the object."""


def _types(name: str) -> list[str]:
    """Return the types of the places of a tool."""
    return [str(field.type) for field in places(TOOLS[name])]


def extension_kind(name: str) -> Kind:
    """Return the kind of an installed package's tool: it has no key, and asks for its places."""
    types = _types(name)
    clicks = 2 if types == ["Rectangle"] else 3 if types == [POINTS] else len(types)
    asks = tuple(f"Click point {number} of {clicks}" for number in range(1, clicks + 1))
    label = name.replace("-", " ").capitalize()
    return Kind(name, label, "", asks, "extensions", "measure")


KINDS = tuple(
    Kind(name, label, key, ASKS.get(name, ("Click on the object",)), group, f"tool-{name}")
    for group, name, key, label in (
        ("lines", "distance", "D", "Distance"),
        ("lines", "step-height", "S", "Step height"),
        ("lines", "profile-width", "W", "Profile width"),
        ("lines", "angle", "A", "Angle"),
        ("outlines", "circle", "C", "Circle"),
        ("outlines", "rectangle", "R", "Rectangle"),
        ("features", "pit", "I", "Pit or bump"),
        ("features", "scratch", "X", "Scratch"),
        ("features", "edge-radius", "E", "Edge radius"),
        ("objects", "ball", "B", "Ball"),
        ("objects", "cylinder", "Y", "Cylinder"),
        ("objects", "cuboid", "U", "Cuboid"),
    )
) + tuple(map(extension_kind, EXTENSIONS))
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


def _rectangle(corners: Sequence[Point]) -> Rectangle:
    """Return the rectangle between two opposite corners."""
    (x0, y0), (x1, y1) = corners
    sides = max(abs(x1 - x0), LEAST_SIDE_MM), max(abs(y1 - y0), LEAST_SIDE_MM)
    return Rectangle(((x0 + x1) / 2.0, (y0 + y1) / 2.0), sides)
