"""Tools that follow an outline: circle and rectangle, as drawn or at the nearest edge."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar, Literal

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.errors import InputError
from gelpolight_core.measurement.area import AreaNodes, Rectangle, nodes_inside
from gelpolight_core.measurement.edges import (
    circle_at_steepest,
    fit_circle,
    rectangle_at_steepest,
)
from gelpolight_core.measurement.measured import Measured, flags_at, map_errors, measured
from gelpolight_core.measurement.roughness import ERROR_NODES, fit_plane, roughness
from gelpolight_core.measurement.tool import Point, ToolResult, tool_result
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.translation import tr

Array = NDArray[np.float64]
Edge = Literal["steepest", "plain"]
EDGES: tuple[Edge, ...] = ("steepest", "plain")


@dataclass(frozen=True, slots=True)
class Circle:
    """A circle through three or more points of an edge.

    Attributes
    ----------
    points_mm : tuple of (float, float)
        On the edge.
    edge : {"steepest", "plain"}
        ``steepest``: the points are only the start. The circle goes through the steepest edge near
        them, at the point on the deeper side where half of that slope is reached; ``plain``:
        through the points themselves.
    """

    name: ClassVar[str] = "circle"
    points_mm: tuple[Point, ...]
    edge: Edge = "steepest"

    def apply(self, heightmap: HeightMap) -> ToolResult:
        """Measure."""
        _check_edge(self.edge)
        found = fit_circle(np.array(self.points_mm, np.float64).reshape(-1, 2))
        if self.edge == "steepest":
            found = circle_at_steepest(heightmap, found)
        turns = np.linspace(0.0, 2.0 * np.pi, 121)
        circle = np.array(found.centre_mm) + found.radius_mm * np.stack(
            [np.cos(turns), np.sin(turns)], axis=1
        )
        share = heightmap.lateral_scale_sd
        stated = share is not None and heightmap.noise_mm is not None

        def figure(name: str, value: float, spread: float) -> Measured:
            sd = math.hypot(spread, (share or 0.0) * value) if stated else None
            return Measured(value, sd, "mm", name)

        figures = (
            figure("diameter", 2.0 * found.radius_mm, 2.0 * found.sd_mm[2]),
            figure("centre_x", found.centre_mm[0], found.sd_mm[0]),
            figure("centre_y", found.centre_mm[1], found.sd_mm[1]),
            Measured(found.rms_mm, None, "mm", "roundness"),
        )
        x, y = found.points_mm.T
        return tool_result(self, figures, (circle,), flags_at(heightmap, x, y))


@dataclass(frozen=True, slots=True)
class RectangleTool:
    """A rectangle: its sides, and depth, tilt and roughness inside.

    Attributes
    ----------
    rectangle : Rectangle
        As drawn.
    edge : {"steepest", "plain"}
        ``steepest``: the sides move to the edges near them, found as for :class:`Circle`;
        ``plain``: they stay as drawn.
    """

    name: ClassVar[str] = "rectangle"
    rectangle: Rectangle
    edge: Edge = "plain"

    def apply(self, heightmap: HeightMap) -> ToolResult:
        """Measure."""
        _check_edge(self.edge)
        # A drawn side lies between two edges, each with an uncertainty of one node.
        by_hand = math.sqrt(2.0) * heightmap.pitch_mm
        area, spread = self.rectangle, (by_hand, by_hand)
        if self.edge == "steepest":
            found = rectangle_at_steepest(heightmap, area)
            area, spread = found.rectangle, found.sides_sd_mm
        nodes = nodes_inside(heightmap, area)
        share = heightmap.lateral_scale_sd
        stated = share is not None and heightmap.noise_mm is not None
        sides = tuple(
            Measured(
                side,
                math.hypot(sd, (share or 0.0) * side) if stated else None,
                "mm",
                name,
            )
            for name, side, sd in zip(("side_a", "side_b"), area.sides_mm, spread, strict=True)
        )
        figures = (
            *sides,
            Measured(area.yaw_deg, None, "deg", "yaw"),
            *_depth_figures(heightmap, nodes),
            *roughness(heightmap, area),
        )
        return tool_result(self, figures, (area.outline_mm,), nodes.flags)


def _depth_figures(heightmap: HeightMap, nodes: AreaNodes) -> tuple[Measured, ...]:
    """Return mean and greatest depth, and tilt of the mean plane."""
    few = nodes.thinned(ERROR_NODES)
    errors = map_errors(heightmap, few.x_mm, few.y_mm)

    def mean(d: Array, stretch: float) -> float:
        return float(d.mean())

    def tilt(d: Array, stretch: float) -> float:
        _, slope_x, slope_y = fit_plane(stretch * few.x_mm, stretch * few.y_mm, d)
        return math.degrees(math.atan(math.hypot(slope_x, slope_y)))

    _, slope_x, slope_y = fit_plane(nodes.x_mm, nodes.y_mm, nodes.depth_mm)
    deepest = int(nodes.depth_mm.argmax())
    at = nodes.x_mm[[deepest]], nodes.y_mm[[deepest]]
    top_errors = map_errors(heightmap, *at)
    return (
        Measured(
            float(nodes.depth_mm.mean()),
            measured("mean_depth", "mm", mean, few.depth_mm, errors).sd,
            "mm",
            "mean_depth",
        ),
        measured("deepest", "mm", mean, nodes.depth_mm[[deepest]], top_errors),
        Measured(
            math.degrees(math.atan(math.hypot(slope_x, slope_y))),
            measured("tilt", "deg", tilt, few.depth_mm, errors).sd,
            "deg",
            "tilt",
        ),
    )


def _check_edge(edge: str) -> None:
    if edge not in EDGES:
        raise InputError(
            tr("unknown edge '{edge}'").format(edge=edge),
            where=tr("measuring tool"),
            advice=tr("Choose one of {names}").format(names=", ".join(EDGES)),
        )
