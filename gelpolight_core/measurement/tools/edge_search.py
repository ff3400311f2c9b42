"""Find the edge near a drawn circle or rectangle, and fit the shape to it.

The edge is the position on the deeper side of the steepest slope nearby where half of that slope is
reached. Where the membrane leaves the face of an object, its slope jumps. A map blurs this jump, so
that the steepest slope itself is one or two nodes outside the object. The edge found is that of
the flat face, without the rounding of the object's edge: an indenter with a rounding of 0.05 mm is
measured 0.1 mm smaller than its nominal size. The fitted indenters account for this.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.robust import robust_fit
from gelpolight_core.geometry.drape import TYPICAL_DECAY_MM
from gelpolight_core.geometry.fits import algebraic_sphere, circle_errors
from gelpolight_core.measurement.area import Rectangle
from gelpolight_core.measurement.measured_value import depth_at
from gelpolight_core.reconstruction.height_map import HeightMap

from .tool_base import Point

REACH_SHARE = 0.25
"""Search distance for the steepest point beside a drawn edge, as a share of the half size."""
REACH_MM = 1.0
"""The same at most."""
LINES = 180
"""Number of lines across the edge of a circle. Each side of a rectangle has a quarter of it."""
MIDDLE = 0.7
"""Share of a rectangle's side that is used: its corners are round."""
FLAT_SHARE = 0.3
"""A slope below this share of the median is not an edge."""
LEAST_SLOPE = 0.02
"""Least slope of an edge (mm per mm)."""
CENTRE_NODES = 0.1
"""Blur moves an edge equally on all sides: the centre is accurate to this share of a node, the
radius to one node."""
ROUNDS = 3
"""Repetitions of the search for a rectangle."""


@dataclass(frozen=True, slots=True)
class FittedCircle:
    """A circle through points of an edge.

    Attributes
    ----------
    centre_mm : (float, float)
    radius_mm : float
    sd_mm : (float, float, float)
        Standard deviations of x, y and radius: the scatter of the points (zero for three points,
        through which there is always a circle), and the blur of the map at the steepest points.
    rms_mm : float
        Deviation of the points from the circle.
    points_mm : (N, 2)
        The points that count.
    """

    centre_mm: Point
    radius_mm: float
    sd_mm: tuple[float, float, float]
    rms_mm: float
    points_mm: Float64Array


def fit_circle(points_mm: Float64Array) -> FittedCircle:
    """Return the circle with the least squares of distances to points.

    Parameters
    ----------
    points_mm : (N, 2)
        At least three, not on one line.

    Raises
    ------
    InputError
        If there is no such circle.
    """
    points = np.asarray(points_mm, np.float64)
    distance = circle_errors(points)
    circle = robust_fit(distance, _algebraic_circle(points))
    x, y, radius = map(float, circle)
    residual_mm = distance(circle)
    if not math.isfinite(radius) or radius > 100.0 * float(np.ptp(points, axis=0).max()):
        raise _no_circle()
    rms = math.sqrt(float(np.mean(residual_mm**2)))
    sd = (0.0, 0.0, 0.0)
    if len(points) > 3:
        jacobian = np.stack(
            [(x - points[:, 0]), (y - points[:, 1]), np.full(len(points), -radius)], axis=1
        )
        jacobian /= radius
        variance = float(residual_mm @ residual_mm) / (len(points) - 3) * _together(points)
        spread = np.sqrt(np.diag(np.linalg.pinv(jacobian.T @ jacobian)) * variance)
        sd = (float(spread[0]), float(spread[1]), float(spread[2]))
    return FittedCircle((x, y), radius, sd, rms, points)


def circle_at_steepest(heightmap: HeightMap, drawn: FittedCircle) -> FittedCircle:
    """Return the circle through the edge at the steepest points near a drawn circle.

    Raises
    ------
    InputError
        If no edge is found near it.
    """
    reach = min(REACH_SHARE * drawn.radius_mm, REACH_MM)
    turns = np.linspace(0.0, 2.0 * np.pi, LINES, endpoint=False)

    def points_at(offset: Float64Array) -> Float64Array:
        radius = drawn.radius_mm + offset
        x = drawn.centre_mm[0] + radius * np.cos(turns)[:, None]
        y = drawn.centre_mm[1] + radius * np.sin(turns)[:, None]
        return np.stack([x, y], axis=-1)

    offset, has_edge = _edge_offsets(heightmap, points_at, reach)
    radius = drawn.radius_mm + offset[has_edge]
    centre = np.array(drawn.centre_mm)
    offset_mm = radius[:, None] * np.stack(
        [np.cos(turns[has_edge]), np.sin(turns[has_edge])], axis=1
    )
    circle = fit_circle(centre + offset_mm)
    pitch = heightmap.pitch_mm
    sd = [
        math.hypot(spread, share * pitch)
        for spread, share in zip(circle.sd_mm, (CENTRE_NODES, CENTRE_NODES, 1.0), strict=True)
    ]
    return replace(circle, sd_mm=(sd[0], sd[1], sd[2]))


def rectangle_at_steepest(heightmap: HeightMap, drawn: Rectangle) -> tuple[Rectangle, Point]:
    """Return the rectangle through the steepest places near a drawn one, with the sd of the sides.

    A straight line is fitted to each side; the four lines rotate together. The search is repeated
    from the result, because the middle of a side is more visible when the sides are correct.

    Raises
    ------
    InputError
        If a side has no edge near it.
    """
    rectangle, sides_sd_mm = _rectangle_round(heightmap, drawn)
    for _ in range(ROUNDS - 1):
        rectangle, sides_sd_mm = _rectangle_round(heightmap, rectangle)
    return rectangle, sides_sd_mm


def _rectangle_round(heightmap: HeightMap, drawn: Rectangle) -> tuple[Rectangle, Point]:
    half = (0.5 * drawn.sides_mm[0], 0.5 * drawn.sides_mm[1])
    shifts, turns, spreads = [], [], []
    for axis, sign in ((0, 1.0), (0, -1.0), (1, 1.0), (1, -1.0)):
        along = np.asarray(np.linspace(-MIDDLE, MIDDLE, LINES // 4) * half[1 - axis], np.float64)
        points_at = _side_points(drawn, axis, sign * half[axis], sign, along)
        reach = min(REACH_SHARE * half[axis], REACH_MM)
        offset, has_edge = _edge_offsets(heightmap, points_at, reach)
        edge_offset = np.asarray(offset[has_edge], np.float64)
        slope, shift = _robust_line(along[has_edge], edge_offset)
        residual_mm = edge_offset - shift - slope * along[has_edge]
        edge = points_at(offset[:, None])[has_edge, 0]
        shifts.append(sign * shift)
        # A slope of the +y side rotates the rectangle in the opposite direction to that of the +x
        # side.
        turns.append(sign * slope * (-1.0 if axis == 0 else 1.0))
        spreads.append(float(np.std(residual_mm)) * math.sqrt(_together(edge) / len(edge)))
    turn = float(np.median(turns))
    middle = (0.5 * (shifts[0] + shifts[1]), 0.5 * (shifts[2] + shifts[3]))
    sides = (
        (drawn.sides_mm[0] + shifts[0] - shifts[1]) * math.cos(turn),
        (drawn.sides_mm[1] + shifts[2] - shifts[3]) * math.cos(turn),
    )
    centre = drawn.place(np.array(middle[0]), np.array(middle[1]))
    fitted = replace(
        drawn,
        centre_mm=(float(centre[0]), float(centre[1])),
        sides_mm=sides,
        yaw_deg=drawn.yaw_deg + math.degrees(math.atan(turn)),
    )
    # Blur moves both edges by the same distance.
    blur = 2.0 * heightmap.pitch_mm
    sd = (math.hypot(*spreads[:2], blur), math.hypot(*spreads[2:], blur))
    return fitted, sd


def _side_points(
    drawn: Rectangle, axis: int, level: float, sign: float, along: Float64Array
) -> Callable[[Float64Array], Float64Array]:
    """Return the function from offsets outwards (lines, n) to places (lines, n, 2)."""

    def points_at(offset: Float64Array) -> Float64Array:
        outwards = level + sign * offset + np.zeros((along.size, 1))
        beside = along[:, None] + np.zeros_like(outwards)
        return drawn.place(outwards, beside) if axis == 0 else drawn.place(beside, outwards)

    return points_at


def _edge_offsets(
    heightmap: HeightMap, points_at: Callable[[Float64Array], Float64Array], reach: float
) -> tuple[Float64Array, NDArray[np.bool_]]:
    """Return the offset of the edge on each line, with a mask of the lines that cross one."""
    step = float(0.5 * heightmap.pitch_mm)
    steps = max(math.ceil(reach / step), 4)
    offsets = np.asarray(step * np.arange(-steps, steps + 1), np.float64)
    points = points_at(offsets[None, :])
    depth = depth_at(heightmap, points[..., 0].ravel(), points[..., 1].ravel())
    depth = depth.reshape(points.shape[:2])
    # Slopes of bilinear depths jump at the nodes; two steps smooth over one node.
    smooth = gaussian_filter1d(depth, 2.0, axis=1, mode="nearest")
    steep = np.nan_to_num(np.abs(np.gradient(smooth, step, axis=1)))
    # The steepest one, not the end of a slope that continues beyond the search distance.
    best = steep[:, 1:-1].argmax(axis=1) + 1
    top = steep[np.arange(len(steep)), best]
    inner = (best > 1) & (best < steep.shape[1] - 2) & np.isfinite(smooth).all(axis=1)
    least = max(FLAT_SHARE * float(np.median(top)), LEAST_SLOPE)
    index, reaches_half = _half_slope(steep, best, deeper_first=smooth[:, 0] > smooth[:, -1])
    has_edge = inner & (top > least) & reaches_half
    if int(has_edge.sum()) < 5:
        raise InputError(
            "there is no edge near the drawn shape", "steepest slope", Remedy.DRAW_AGAIN
        )
    return np.asarray(offsets[0] + step * index), has_edge


def _half_slope(
    steep: Float64Array, best: NDArray[np.intp], *, deeper_first: NDArray[np.bool_]
) -> tuple[Float64Array, NDArray[np.bool_]]:
    """Return the position of half of the greatest slope on the deeper side, with a valid mask."""
    index, reaches_half = np.zeros(len(steep)), np.zeros(len(steep), bool)
    for k, row in enumerate(steep):
        walk = -1 if deeper_first[k] else 1
        half = 0.5 * row[best[k]]
        side = row[best[k] :: walk]
        below = np.flatnonzero(side < half)
        if below.size:
            end = int(below[0])
            share = (side[end - 1] - half) / (side[end - 1] - side[end])
            index[k], reaches_half[k] = best[k] + walk * (end - 1 + share), True
    return index, reaches_half


def _robust_line(x: Float64Array, y: Float64Array) -> tuple[float, float]:
    """Return slope and level of a line, robust against outliers."""

    def distance(p: Float64Array) -> Float64Array:
        return np.asarray(y - p[0] * x - p[1])

    start = np.array([0.0, float(np.median(y))])
    slope, level = robust_fit(distance, start)
    return float(slope), float(level)


def _algebraic_circle(points: Float64Array) -> Float64Array:
    """Return x, y and radius of the circle through points."""
    middle = points.mean(axis=0)
    centred = points - middle
    size = float(np.abs(centred).max()) if len(points) else 0.0
    if len(points) < 3 or not np.isfinite(points).all() or size <= 0.0:
        raise _no_circle()
    # For points on one line, the matrix has no full rank.
    if np.linalg.svd(centred / size, compute_uv=False)[-1] < 1e-6:
        raise _no_circle()
    place, radius = algebraic_sphere(centred)
    return np.array([*(place + middle), radius])


def _together(points: Float64Array) -> float:
    """Return how many neighbouring points of an edge have a common error (within the drape)."""
    gaps = np.hypot(*np.diff(points, axis=0).T)
    gap = max(float(np.median(gaps)), 1e-9)
    return max(TYPICAL_DECAY_MM / gap, 1.0)


def _no_circle() -> InputError:
    return InputError("no circle goes through these points", "circle", Remedy.PLACE_POINTS)
