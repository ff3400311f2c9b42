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
    on_it = (tr("Click on the object"),)
    return (
        Kind(
            "distance",
            tr("Distance"),
            "D",
            (tr("Click the first point"), tr("Click the second point")),
            "lines",
        ),
        Kind(
            "step-height",
            tr("Step height"),
            "S",
            (tr("Click the lower area"), tr("Click the area to compare with it")),
            "lines",
        ),
        Kind(
            "profile-width",
            tr("Profile width"),
            "W",
            (tr("Click the start of the section"), tr("Click the end of the section")),
            "lines",
        ),
        Kind(
            "angle",
            tr("Angle"),
            "A",
            (
                tr("Click the end of one arm"),
                tr("Click the apex"),
                tr("Click the end of the other arm"),
            ),
            "lines",
        ),
        Kind(
            "circle",
            tr("Circle"),
            "C",
            (
                tr("Click a point on the edge"),
                tr("Click a second point on the edge"),
                tr("Click a third point on the edge"),
            ),
            "outlines",
        ),
        Kind(
            "rectangle",
            tr("Rectangle"),
            "R",
            (tr("Click one corner"), tr("Click the opposite corner")),
            "outlines",
        ),
        Kind(
            "pit",
            tr("Pit or bump"),
            "I",
            (
                tr("Click one corner, beside the pit or bump"),
                tr("Click the opposite corner, on the other side"),
            ),
            "features",
        ),
        Kind(
            "scratch",
            tr("Scratch or ridge"),
            "X",
            (
                tr("Click the surface on one side of the scratch"),
                tr("Click the surface on the other side"),
            ),
            "features",
        ),
        Kind(
            "edge-radius",
            tr("Edge radius"),
            "E",
            (
                tr("Click where the rounding begins"),
                tr("Click across the edge, where the rounding ends"),
            ),
            "features",
        ),
        Kind("ball", tr("Ball"), "B", on_it, "objects"),
        Kind("cylinder", tr("Cylinder"), "Y", on_it, "objects"),
        Kind("cuboid", tr("Cuboid"), "U", on_it, "objects"),
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
    return cast(
        Tool,
        made(
            *(
                Rectangle(point, sides) if kind == "Rectangle" else point
                for kind, point in zip(types, points, strict=True)
            )
        ),
    )


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
