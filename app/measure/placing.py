"""From clicks on the map to a tool: how many places each asks for, and in which order; no Qt."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from gelpolight_core.measurement.tools import (
    Angle,
    Ball,
    Circle,
    Cuboid,
    Cylinder,
    Distance,
    ProfileWidth,
    Rectangle,
    RectangleTool,
    StepHeight,
    Tool,
)
from gelpolight_core.translation import tr

Point = tuple[float, float]
STEP_SIDE_MM = 0.8
LEAST_SIDE_MM = 0.1
FIRST_REACH_MM = 2.0
INDENTERS = ("ball", "cylinder", "cuboid")


@dataclass(frozen=True, slots=True)
class Kind:
    """One kind of tool, as a person chooses it.

    Attributes
    ----------
    name : str
        As in the core.
    label : str
        What people call it.
    key : str
        The key that chooses it.
    asks : tuple of str
        What each click means.
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
            "distance", tr("Distance"), "D", (tr("Click the first place"), tr("Click the second"))
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
            (tr("Click where the section begins"), tr("Click where it ends")),
        ),
        Kind(
            "angle",
            tr("Angle"),
            "A",
            (tr("Click the end of one arm"), tr("Click the apex"), tr("Click the other arm's end")),
        ),
        Kind(
            "circle",
            tr("Circle"),
            "C",
            (tr("Click a place of the rim"), tr("Click a second"), tr("Click a third")),
        ),
        Kind(
            "rectangle",
            tr("Rectangle"),
            "R",
            (tr("Click one corner"), tr("Click the opposite corner")),
        ),
        Kind("ball", tr("Ball"), "B", on_it),
        Kind("cylinder", tr("Cylinder"), "Y", on_it),
        Kind("cuboid", tr("Cuboid"), "U", on_it),
    )


def kind_label(name: str) -> str:
    """Return what people call a kind of tool."""
    return next((kind.label for kind in kinds() if kind.name == name), name)


def make_tool(name: str, places: Sequence[Point]) -> Tool:
    """Return the tool through places, as many as its kind asks for."""
    match name:
        case "distance":
            return Distance(places[0], places[1])
        case "step-height":
            sides = (STEP_SIDE_MM, STEP_SIDE_MM)
            return StepHeight(Rectangle(places[0], sides), Rectangle(places[1], sides))
        case "profile-width":
            return ProfileWidth(places[0], places[1])
        case "angle":
            return Angle(apex_mm=places[1], first_mm=places[0], second_mm=places[2])
        case "circle":
            return Circle(tuple(places))
        case "rectangle":
            (x0, y0), (x1, y1) = places
            sides = max(abs(x1 - x0), LEAST_SIDE_MM), max(abs(y1 - y0), LEAST_SIDE_MM)
            return RectangleTool(Rectangle(((x0 + x1) / 2.0, (y0 + y1) / 2.0), sides))
    return {"ball": Ball, "cylinder": Cylinder, "cuboid": Cuboid}[name](places[0])


def first_places(name: str, middle_mm: Point) -> tuple[Point, ...]:
    """Return places for a tool that is put there by a key, about the middle of what is shown."""
    x, y = middle_mm
    r = FIRST_REACH_MM
    match name:
        case "angle":
            return (x - r, y - r), (x, y), (x + r, y - r)
        case "circle":
            return (x - r, y), (x, y - r), (x + r, y)
        case "rectangle":
            return (x - r, y - r), (x + r, y + r)
        case "ball" | "cylinder" | "cuboid":
            return (middle_mm,)
    return (x - r, y), (x + r, y)
