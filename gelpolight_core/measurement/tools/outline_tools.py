"""Tools that follow an outline: circle and rectangle, as drawn or at the nearest edge."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.geometry.fits import fit_plane
from gelpolight_core.measurement.area import AreaNodes, Rectangle, nodes_inside
from gelpolight_core.measurement.measured_value import (
    MeasuredValue,
    errors_at,
    flags_at,
    lateral_length,
    measure_with_errors,
)
from gelpolight_core.measurement.roughness import area_estimator, roughness
from gelpolight_core.reconstruction.height_map import HeightMap

from .edge_search import circle_at_steepest, fit_circle, rectangle_at_steepest
from .tool_base import PaletteEntry, Point, Tool, ToolResult, tool_result

Edge = Literal["steepest", "plain"]
EDGES: tuple[Edge, ...] = ("steepest", "plain")


@dataclass(frozen=True, slots=True)
class CircleTool(Tool):
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

    name = "circle"
    palette = PaletteEntry(
        section="outlines",
        order=10,
        tip="Diameter, deviation from a circle",
        prompts=(
            "Click a point on the edge",
            "Click a second point on the edge",
            "Click a third point on the edge",
        ),
        key="C",
    )
    points_mm: tuple[Point, ...]
    edge: Edge = "steepest"

    def apply(self, heightmap: HeightMap) -> ToolResult:
        """Measure."""
        _check_edge(self.edge)
        fitted = fit_circle(np.array(self.points_mm, np.float64).reshape(-1, 2))
        if self.edge == "steepest":
            fitted = circle_at_steepest(heightmap, fitted)
        turns = np.linspace(0.0, 2.0 * np.pi, 121)
        circle = np.array(fitted.centre_mm) + fitted.radius_mm * np.stack(
            [np.cos(turns), np.sin(turns)], axis=1
        )
        figures = (
            lateral_length(heightmap, "diameter", 2.0 * fitted.radius_mm, 2.0 * fitted.sd_mm[2]),
            lateral_length(heightmap, "centre_x", fitted.centre_mm[0], fitted.sd_mm[0]),
            lateral_length(heightmap, "centre_y", fitted.centre_mm[1], fitted.sd_mm[1]),
            MeasuredValue(fitted.rms_mm, None, "mm", "roundness"),
        )
        x, y = fitted.points_mm.T
        return tool_result(self, figures, (circle,), flags_at(heightmap, x, y))


@dataclass(frozen=True, slots=True)
class RectangleTool(Tool):
    """A rectangle: its sides, and depth, tilt and roughness inside.

    Attributes
    ----------
    rectangle : Rectangle
        As drawn.
    edge : {"steepest", "plain"}
        ``steepest``: the sides move to the edges near them, found as for :class:`CircleTool`;
        ``plain``: they stay as drawn.
    """

    name = "rectangle"
    palette = PaletteEntry(
        section="outlines",
        order=20,
        tip="Sides, mean and largest depth, tilt, roughness",
        prompts=("Click one corner", "Click the opposite corner"),
        key="R",
    )
    depth_figures = ("mean_depth", "deepest")
    rectangle: Rectangle
    edge: Edge = "plain"

    def apply(self, heightmap: HeightMap) -> ToolResult:
        """Measure."""
        _check_edge(self.edge)
        area = self.rectangle
        spread: tuple[float | None, float | None] = (None, None)
        if self.edge == "steepest":
            area, spread = rectangle_at_steepest(heightmap, area)
        nodes = nodes_inside(heightmap, area)
        figures = (
            lateral_length(heightmap, "side_a", area.sides_mm[0], spread[0]),
            lateral_length(heightmap, "side_b", area.sides_mm[1], spread[1]),
            MeasuredValue(area.yaw_deg, None, "deg", "yaw"),
            *_depth_figures(heightmap, nodes),
            *roughness(heightmap, area),
        )
        return tool_result(self, figures, (area.outline_mm,), nodes.flags)


def _depth_figures(heightmap: HeightMap, nodes: AreaNodes) -> tuple[MeasuredValue, ...]:
    """Return mean and greatest depth, and tilt of the mean plane."""
    figure = area_estimator(heightmap, nodes)
    top = np.argmax(nodes.depth_mm, keepdims=True)
    errors = errors_at(heightmap, nodes.x_mm[top], nodes.y_mm[top])
    return (
        figure("mean_depth", "mm", lambda x, y, depth: float(depth.mean())),
        measure_with_errors(
            "deepest", "mm", lambda d, stretch: float(d[0]), nodes.depth_mm[top], errors
        ),
        figure("tilt", "deg", _tilt_deg),
    )


def _tilt_deg(x_mm: Float64Array, y_mm: Float64Array, depth_mm: Float64Array) -> float:
    return math.degrees(math.atan(math.hypot(*fit_plane(x_mm, y_mm, depth_mm)[1:])))


def _check_edge(edge: str) -> None:
    if edge not in EDGES:
        raise InputError(
            f"unknown edge '{edge}'",
            "measuring tool",
            Remedy.ONE_OF.format(names=", ".join(EDGES)),
        )
