"""Tools between points on the surface: distance, angle, and the step between two areas."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.errors import InputError
from gelpolight_core.measurement.area import Rectangle, nodes_inside
from gelpolight_core.measurement.measured import (
    Measured,
    depth_at,
    flags_at,
    map_errors,
    measured,
    value_at,
)
from gelpolight_core.measurement.roughness import ERROR_NODES
from gelpolight_core.measurement.tool import Point, ToolResult, tool_result
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.translation import tr

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Distance:
    """The distance between two places: in the plane, in space, and in depth.

    Attributes
    ----------
    a_mm, b_mm : (float, float)
        The places, (x, y).
    """

    name: ClassVar[str] = "distance"
    a_mm: Point
    b_mm: Point

    def apply(self, heightmap: HeightMap) -> ToolResult:
        """Measure; the depths are those of the surface at the two places."""
        x, y = np.array([self.a_mm, self.b_mm]).T
        depth = _known_depth(heightmap, x, y)
        errors = map_errors(heightmap, x, y)
        across = math.hypot(x[1] - x[0], y[1] - y[0])

        def plane(d: Array, stretch: float) -> float:
            return stretch * across

        def space(d: Array, stretch: float) -> float:
            return math.hypot(stretch * across, float(d[1] - d[0]))

        def deeper(d: Array, stretch: float) -> float:
            return float(d[1] - d[0])

        positions = np.stack([x, y], axis=1)

        def by_positions(at: Array, d: Array) -> tuple[float, ...]:
            away = math.hypot(*(at[1] - at[0]))
            return away, math.hypot(away, float(d[1] - d[0])), float(d[1] - d[0])

        figures = (
            measured("distance", "mm", plane, depth, errors),
            measured("distance_3d", "mm", space, depth, errors),
            measured("depth_difference", "mm", deeper, depth, errors),
        )
        return tool_result(
            self,
            with_placing(figures, by_positions, positions, heightmap),
            (positions,),
            flags_at(heightmap, x, y),
        )


@dataclass(frozen=True, slots=True)
class StepHeight:
    """How much deeper the surface is in one rectangle than in another.

    Attributes
    ----------
    first, second : Rectangle
        The mean depth of each counts; the step is the second's less the first's.
    """

    name: ClassVar[str] = "step-height"
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

        def compute(d: Array, stretch: float) -> float:
            return float(d[split:].mean() - d[:split].mean())

        spread = measured("step_height", "mm", compute, depth, map_errors(heightmap, x, y)).sd
        return tool_result(
            self,
            (Measured(step, spread, "mm", "step_height"),),
            (self.first.outline_mm, self.second.outline_mm),
            np.concatenate([part.flags for part in parts]),
        )


@dataclass(frozen=True, slots=True)
class Angle:
    """The angle at an apex between two arms: in the plane, and in space.

    Attributes
    ----------
    first_mm, apex_mm, second_mm : (float, float)
        Places, (x, y): the end of one arm, the apex, the end of the other arm.
    """

    name: ClassVar[str] = "angle"
    first_mm: Point
    apex_mm: Point
    second_mm: Point

    def apply(self, heightmap: HeightMap) -> ToolResult:
        """Measure; in space, the arms end on the surface.

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
            raise InputError(
                tr("an arm of the angle has no length"),
                where=tr("angle"),
                advice=tr("Place three different points, the apex second"),
            )
        x, y = positions.T
        depth = _known_depth(heightmap, x, y)
        errors = map_errors(heightmap, x, y)

        def plane(d: Array, stretch: float) -> float:
            return _angle_deg(arms[0], arms[1])

        def space(d: Array, stretch: float) -> float:
            first, second = (
                np.array([*(stretch * arm), rise])
                for arm, rise in zip(arms, (d[0] - d[1], d[2] - d[1]), strict=True)
            )
            return _angle_deg(first, second)

        def by_positions(at: Array, d: Array) -> tuple[float, ...]:
            to_first, to_second = at[0] - at[1], at[2] - at[1]
            first, second = np.array([*to_first, d[0] - d[1]]), np.array([*to_second, d[2] - d[1]])
            return _angle_deg(to_first, to_second), _angle_deg(first, second)

        figures = (
            measured("angle", "deg", plane, depth, errors),
            measured("angle_3d", "deg", space, depth, errors),
        )
        return tool_result(
            self,
            with_placing(figures, by_positions, positions, heightmap),
            (positions,),
            flags_at(heightmap, x, y),
        )


def with_placing(
    figures: tuple[Measured, ...],
    compute: Callable[[Array, Array], tuple[float, ...]],
    positions_mm: Array,
    heightmap: HeightMap,
) -> tuple[Measured, ...]:
    """Add the uncertainty of placing points by hand, one node, to figures.

    Each point is moved by a node in x and in y on the surface, and the changes count as
    independent. Figures without a standard deviation remain without one.

    Parameters
    ----------
    figures : tuple of Measured
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
            there = []
            for step in (-pitch, pitch):
                moved = np.array(positions_mm, np.float64)
                moved[point, axis] += step
                depth = value_at(heightmap, heightmap.depth_mm, *moved.T)
                there.append(compute(moved, depth))
            spread += (0.5 * np.subtract(there[0], there[1])) ** 2
    return tuple(
        figure if figure.sd is None else replace(figure, sd=math.hypot(figure.sd, math.sqrt(own)))
        for figure, own in zip(figures, spread.tolist(), strict=True)
    )


def _known_depth(heightmap: HeightMap, x_mm: Array, y_mm: Array) -> Array:
    """Return the depth at points chosen by the user; refuse a point outside."""
    depth = depth_at(heightmap, x_mm, y_mm)
    if not np.isfinite(depth).all():
        k = int(np.flatnonzero(~np.isfinite(depth))[0])
        raise InputError(
            tr("the point ({x:g}, {y:g}) mm lies outside the working area").format(
                x=x_mm[k], y=y_mm[k]
            ),
            where=tr("measuring tool"),
            advice=tr("Move it onto the map"),
        )
    return depth


def _angle_deg(first: Array, second: Array) -> float:
    cosine = float(first @ second) / float(np.linalg.norm(first) * np.linalg.norm(second))
    return math.degrees(math.acos(min(max(cosine, -1.0), 1.0)))
