"""Tools between points on the surface: distance, angle, and the step between two areas."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.measurement.area import Rectangle, nodes_inside
from gelpolight_core.measurement.measured_value import (
    MeasuredValue,
    depth_at,
    errors_at,
    flags_at,
    measure_with_errors,
    value_at,
)
from gelpolight_core.measurement.roughness import ERROR_NODES
from gelpolight_core.reconstruction.height_map import HeightMap

from .tool_base import PaletteEntry, Point, Tool, ToolResult, tool_result


@dataclass(frozen=True, slots=True)
class DistanceTool(Tool):
    """The distance between two places: in the plane, in space, and in depth.

    Attributes
    ----------
    a_mm, b_mm : (float, float)
        The places, (x, y).
    """

    name = "distance"
    palette = PaletteEntry(
        section="lines",
        order=10,
        tip="Distance in the plane and in space, difference of depth",
        prompts=("Click the first point", "Click the second point"),
        key="D",
    )
    depth_figures = ("depth_difference",)
    a_mm: Point
    b_mm: Point

    def apply(self, heightmap: HeightMap) -> ToolResult:
        """Measure, with the depths of the surface at the two places."""

        def compute(at: Float64Array, depth: Float64Array) -> tuple[float, ...]:
            across, deeper = math.hypot(*(at[1] - at[0])), float(depth[1] - depth[0])
            return across, math.hypot(across, deeper), deeper

        names = ("distance", "distance_3d", "depth_difference")
        positions = np.array([self.a_mm, self.b_mm])
        return _between_points(self, heightmap, positions, names, "mm", compute)


@dataclass(frozen=True, slots=True)
class StepHeightTool(Tool):
    """How much deeper the surface is in one rectangle than in another.

    Attributes
    ----------
    first, second : Rectangle
        The mean depth of each counts; the step is the second's less the first's.
    """

    name = "step-height"
    palette = PaletteEntry(
        section="lines",
        order=20,
        tip="Height between two areas, without their tilt",
        prompts=("Click the lower area", "Click the area to compare with it"),
        key="S",
    )
    depth_figures = ("step_height",)
    first: Rectangle
    second: Rectangle

    def apply(self, heightmap: HeightMap) -> ToolResult:
        """Measure."""
        parts = [nodes_inside(heightmap, area) for area in (self.first, self.second)]
        step = float(parts[1].depth_mm.mean() - parts[0].depth_mm.mean())
        few = [part.thinned(ERROR_NODES) for part in parts]
        x, y, depth = (
            np.concatenate([getattr(part, key) for part in few])
            for key in ("x_mm", "y_mm", "depth_mm")
        )
        split = few[0].x_mm.size

        def compute(d: Float64Array, stretch: float) -> float:
            return float(d[split:].mean() - d[:split].mean())

        spread = measure_with_errors(
            "step_height", "mm", compute, depth, errors_at(heightmap, x, y)
        ).sd
        return tool_result(
            self,
            (MeasuredValue(step, spread, "mm", "step_height"),),
            (self.first.outline_mm, self.second.outline_mm),
            np.concatenate([part.flags for part in parts]),
        )


@dataclass(frozen=True, slots=True)
class AngleTool(Tool):
    """The angle at an apex between two arms: in the plane, and in space.

    Attributes
    ----------
    first_mm, apex_mm, second_mm : (float, float)
        Places, (x, y): the end of one arm, the apex, the end of the other arm.
    """

    name = "angle"
    palette = PaletteEntry(
        section="lines",
        order=40,
        tip="Angle in the plane and in space",
        prompts=("Click the end of one arm", "Click the apex", "Click the end of the other arm"),
        key="A",
    )
    first_mm: Point
    apex_mm: Point
    second_mm: Point

    def apply(self, heightmap: HeightMap) -> ToolResult:
        """Measure. In space, the arms end on the surface.

        Parameters
        ----------
        heightmap : HeightMap
            What is measured.

        Raises
        ------
        InputError
            If two of the points are the same, or one lies outside the map.
        """
        positions = np.array([self.first_mm, self.apex_mm, self.second_mm])
        arms = positions[[0, 2]] - positions[1]
        if not (np.isfinite(arms).all() and np.hypot(*arms.T).min() > 0.0):
            raise InputError("an arm of the angle has no length", "angle", Remedy.PLACE_POINTS)

        def compute(at: Float64Array, depth: Float64Array) -> tuple[float, ...]:
            first, second = at[0] - at[1], at[2] - at[1]
            rising = (
                np.array([*first, depth[0] - depth[1]]),
                np.array([*second, depth[2] - depth[1]]),
            )
            return _angle_deg(first, second), _angle_deg(*rising)

        names = ("angle", "angle_3d")
        return _between_points(self, heightmap, positions, names, "deg", compute)


def _between_points(
    tool: DistanceTool | AngleTool,
    heightmap: HeightMap,
    positions_mm: Float64Array,
    names: tuple[str, ...],
    unit: str,
    compute: Callable[[Float64Array, Float64Array], tuple[float, ...]],
) -> ToolResult:
    """Return the figures that `compute` gives from places (N, 2) and depths (N,)."""
    x, y = positions_mm.T
    depth, errors = _known_depth(heightmap, x, y), errors_at(heightmap, x, y)

    def figure(k: int) -> Callable[[Float64Array, float], float]:
        return lambda d, stretch: compute(stretch * positions_mm, d)[k]

    figures = tuple(
        measure_with_errors(name, unit, figure(k), depth, errors) for k, name in enumerate(names)
    )
    return tool_result(
        tool,
        with_placing(figures, compute, positions_mm, heightmap),
        (positions_mm,),
        flags_at(heightmap, x, y),
    )


def with_placing(
    figures: tuple[MeasuredValue, ...],
    compute: Callable[[Float64Array, Float64Array], tuple[float, ...]],
    positions_mm: Float64Array,
    heightmap: HeightMap,
) -> tuple[MeasuredValue, ...]:
    """Add the uncertainty of placing points by hand, one node, to figures.

    Each point is moved by a node in x and in y on the surface, and the changes count as
    independent. Figures without a standard deviation remain without one.

    Parameters
    ----------
    figures : tuple of MeasuredValue
        With the standard deviations of the depth alone.
    compute : callable (places (N, 2), depths (N,)) -> values
        The same figures from places.
    positions_mm : (N, 2)
        Where the points are.
    heightmap : HeightMap
        What was measured on.
    """
    if all(figure.sd is None for figure in figures):
        return figures
    pitch = heightmap.pitch_mm
    spread = np.zeros(len(figures))
    for point in range(len(positions_mm)):
        for axis in range(2):
            values = []
            for step in (-pitch, pitch):
                moved = np.array(positions_mm, np.float64)
                moved[point, axis] += step
                depth = value_at(heightmap, heightmap.depth_mm, *moved.T)
                values.append(compute(moved, depth))
            spread += (0.5 * np.subtract(values[0], values[1])) ** 2
    return tuple(
        figure
        if figure.sd is None
        else replace(figure, sd=math.hypot(figure.sd, math.sqrt(variance)))
        for figure, variance in zip(figures, spread.tolist(), strict=True)
    )


def _known_depth(heightmap: HeightMap, x_mm: Float64Array, y_mm: Float64Array) -> Float64Array:
    """Return the depth at points chosen by the user. Refuse a point outside."""
    depth = depth_at(heightmap, x_mm, y_mm)
    if not np.isfinite(depth).all():
        k = int(np.flatnonzero(~np.isfinite(depth))[0])
        raise InputError(
            f"the point ({x_mm[k]:g}, {y_mm[k]:g}) mm lies outside the working area",
            "measuring tool",
            Remedy.MOVE_INSIDE,
        )
    return depth


def _angle_deg(first: Float64Array, second: Float64Array) -> float:
    cosine = float(first @ second) / float(np.linalg.norm(first) * np.linalg.norm(second))
    return math.degrees(math.acos(min(max(cosine, -1.0), 1.0)))
