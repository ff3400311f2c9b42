"""From clicks on the map to a tool: number and order of its points. Without Qt."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

from gelpolight_core.measurement.tools import TOOLS, Angle, Circle, Rectangle, StepHeight, Tool
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
    """

    name: str
    label: str
    key: str
    asks: tuple[str, ...]


def kinds() -> tuple[Kind, ...]:
    """Return the palette: the tools in its order."""
    on_it = (tr("Click on the object"),)
    return (
        Kind(
            "distance",
            tr("Distance"),
            "D",
            (tr("Click the first point"), tr("Click the second point")),
        ),
        Kind(
            "step-height",
            tr("Step height"),
            "S",
            (tr("Click the lower area"), tr("Click the area to compare with it")),
        ),
        Kind(
            "profile-width",
            tr("Profile width"),
            "W",
            (tr("Click the start of the section"), tr("Click the end of the section")),
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
        ),
        Kind(
            "rectangle",
            tr("Rectangle"),
            "R",
            (tr("Click one corner"), tr("Click the opposite corner")),
        ),
        Kind(
            "pit",
            tr("Pit or bump"),
            "I",
            (
                tr("Click one corner, beside the pit or bump"),
                tr("Click the opposite corner, on the other side"),
            ),
        ),
        Kind(
            "scratch",
            tr("Scratch or ridge"),
            "X",
            (
                tr("Click the surface on one side of the scratch"),
                tr("Click the surface on the other side"),
            ),
        ),
        Kind(
            "edge-radius",
            tr("Edge radius"),
            "E",
            (
                tr("Click where the rounding begins"),
                tr("Click across the edge, where the rounding ends"),
            ),
        ),
        Kind("ball", tr("Ball"), "B", on_it),
        Kind("cylinder", tr("Cylinder"), "Y", on_it),
        Kind("cuboid", tr("Cuboid"), "U", on_it),
    )


def kind_label(name: str) -> str:
    """Return the name of a kind of tool for the user."""
    return next((kind.label for kind in kinds() if kind.name == name), name)


def make_tool(name: str, points: Sequence[Point]) -> Tool:
    """Return the tool through points, as many as its kind needs."""
    made: Any = TOOLS[name]
    match name:
        case "step-height":
            sides = (STEP_SIDE_MM, STEP_SIDE_MM)
            return StepHeight(Rectangle(points[0], sides), Rectangle(points[1], sides))
        case "angle":
            return Angle(apex_mm=points[1], first_mm=points[0], second_mm=points[2])
        case "circle":
            return Circle(tuple(points))
        case "rectangle" | "pit":
            return cast(Tool, made(_rectangle(points)))
    return cast(Tool, made(*points))


def _rectangle(corners: Sequence[Point]) -> Rectangle:
    """Return the rectangle between two opposite corners."""
    (x0, y0), (x1, y1) = corners
    sides = max(abs(x1 - x0), LEAST_SIDE_MM), max(abs(y1 - y0), LEAST_SIDE_MM)
    return Rectangle(((x0 + x1) / 2.0, (y0 + y1) / 2.0), sides)


def first_points(name: str, middle_mm: Point) -> tuple[Point, ...]:
    """Return points for a tool that is placed with the keyboard, around the centre of the view."""
    x, y = middle_mm
    r = FIRST_REACH_MM
    match name:
        case "angle":
            return (x - r, y - r), (x, y), (x + r, y - r)
        case "circle":
            return (x - r, y), (x, y - r), (x + r, y)
        case "rectangle" | "pit":
            return (x - r, y - r), (x + r, y + r)
        case "ball" | "cylinder" | "cuboid":
            return (middle_mm,)
    return (x - r, y), (x + r, y)
