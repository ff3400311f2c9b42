"""Picking in the 3D view: points on the surface, pins, and distances between pins."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from gelpolight_core.base.arrays import Float64Array, PointXY
from gelpolight_core.base.compared_quantity import value_text

from .display_surface import DisplaySurface

_STEPS = 512
_LINE_STEP_MM = 0.12
_LINE_POINTS = 400


def intersect_ray(
    surface: DisplaySurface, start: Float64Array, end: Float64Array
) -> PointXY | None:
    """Return where a ray first hits the surface, or None if it misses.

    Parameters
    ----------
    surface : DisplaySurface
        A height field, so that no mesh needs to be searched.
    start, end : (3,)
        Ends of the ray: x right, y down, depth; mm without exaggeration.

    Returns
    -------
    place : (x, y) or None
        In mm, sensor frame.
    """
    low = np.array([surface.x_mm.min(), surface.y_mm[0], surface.depth_mm.min()], np.float64)
    high = np.array([surface.x_mm.max(), surface.y_mm[-1], surface.depth_mm.max()], np.float64)
    margin = 1e-3 + 1e-4 * (high - low)
    along = np.where(np.abs(end - start) < 1e-12, 1e-12, end - start)
    ends = np.sort(np.stack([low - margin - start, high + margin - start]) / along, axis=0)
    first, last = max(ends[0].max(), 0.0), ends[1].min()
    if last <= first:
        return None
    t = np.linspace(first, last, _STEPS)
    for _ in range(2):  # the second pass refines the step in which the ray crosses the surface
        points = start + t[:, None] * along
        depths = surface.depth_at(points[:, 0], points[:, 1])
        below = points[:, 2] <= depths
        # From above or below: the first change of side is the surface.
        side = np.where(np.isfinite(depths), np.where(below, 1, -1), 0)
        changed = np.flatnonzero(side[1:] * side[:-1] < 0)
        if changed.size == 0:
            return None
        t = np.linspace(t[changed[0]], t[changed[0] + 1], _STEPS)
    x, y, _ = start + 0.5 * (t[0] + t[-1]) * along
    return float(x), float(y)


@dataclass(frozen=True, slots=True)
class PinDistance:
    """Measurements between two points on the surface.

    Attributes
    ----------
    distance_mm : float
        Straight-line distance in space, with true depths.
    across_mm : float
        Distance in the membrane's plane.
    rise_mm : float
        Depth of the second point minus depth of the first.
    angle_deg : float
        Angle of their connecting line to the membrane's plane.
    """

    distance_mm: float
    across_mm: float
    rise_mm: float
    angle_deg: float


def measure_pins(surface: DisplaySurface, first: PointXY, second: PointXY) -> PinDistance | None:
    """Return the measurements between two points, or None if one is off the surface."""
    x, y = np.array([first, second]).T
    low, high = (float(v) for v in surface.depth_at(x, y))
    if not (math.isfinite(low) and math.isfinite(high)):
        return None
    across, rise = math.dist(first, second), high - low
    return PinDistance(
        math.hypot(across, rise), across, rise, math.degrees(math.atan2(rise, max(across, 1e-12)))
    )


def densify_line(corners_mm: tuple[PointXY, ...]) -> Float64Array:
    """Return points (N, 2) along a line, dense enough to follow the relief."""
    corners = np.asarray(corners_mm, np.float64)
    length = np.concatenate([[0.0], np.cumsum([math.dist(a, b) for a, b in pairwise(corners)])])
    if length[-1] <= 0.0:
        return corners[:1]
    count = min(max(int(length[-1] / _LINE_STEP_MM), 1) + 1, _LINE_POINTS)
    at = np.union1d(np.linspace(0.0, length[-1], count), length)
    return np.stack([np.interp(at, length, corners[:, k]) for k in (0, 1)], axis=-1)


PIN_NAMES = ("A", "B")


def with_pin(pins: tuple[PointXY, ...], point: PointXY) -> tuple[PointXY, ...]:
    """Return the pins with one more. A third pin replaces the oldest."""
    return (*pins, point)[-len(PIN_NAMES) :]


def pins_text(surface: DisplaySurface, pins: tuple[PointXY, ...]) -> str:
    """Return position and depth of each pin, and the measurements between two, one line each."""
    lines = [
        (
            f"{name}: x {x:.2f} mm  y {y:.2f} mm  depth "
            f"{value_text(float(surface.depth_at(np.array([x]), np.array([y]))[0]))}"
        )
        for name, (x, y) in zip(PIN_NAMES, pins, strict=False)
    ]
    distance = measure_pins(surface, *pins) if len(pins) == len(PIN_NAMES) else None
    if distance is not None:
        lines += [
            f"distance {value_text(distance.distance_mm)}, across {value_text(distance.across_mm)}",
            f"height difference {value_text(distance.rise_mm, sign='+')}, "
            f"angle {distance.angle_deg:.1f}°",
        ]
    return "\n".join(lines)
