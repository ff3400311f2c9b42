"""A depth map as rows of nodes for the 3D view, and points on it. No Qt, no pyvista."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float64Array, PointXY
from gelpolight_core.base.compared_quantity import readable_unit, unit_behind, value_text
from gelpolight_core.reconstruction.height_map import Flag, HeightMap

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
    if len(pins) == len(PIN_NAMES):
        first_mm, second_mm = surface.depth_at(*np.array(pins).T).tolist()
        across_mm, rise_mm = math.dist(*pins), second_mm - first_mm
        if math.isfinite(first_mm) and math.isfinite(second_mm):
            angle_deg = math.degrees(math.atan2(rise_mm, max(across_mm, 1e-12)))
            lines += [
                f"distance {value_text(math.hypot(across_mm, rise_mm))}, "
                f"across {value_text(across_mm)}",
                f"height difference {value_text(rise_mm, sign='+')}, angle {angle_deg:.1f}°",
            ]
    return "\n".join(lines)


# A software renderer is fast enough for this many nodes per side. The texture carries the detail.
LIVE_NODES = 128

MM = "(mm)"
"""At the end of the titles of scales of lengths."""

Rgb = tuple[int, int, int]


@dataclass(frozen=True, slots=True, eq=False)
class ColourScale:
    """The meaning of a surface's colours.

    Attributes
    ----------
    title : str
        Quantity with its unit.
    table : (256, 3) uint8
        Colours from `low` to `high`.
    low, high : float
        Values of the first and the last colour.
    names : tuple of (str, (r, g, b))
        Names of single colours, such as flags, instead of values.
    """

    title: str
    table: NDArray[np.uint8]
    low: float
    high: float
    names: tuple[tuple[str, Rgb], ...] = ()

    def in_unit(self) -> ColourScale:
        """Return it in the readable unit if it is of lengths in mm, for a legend."""
        if MM not in self.title:
            return self
        unit, factor = readable_unit(self.low, self.high)
        title = self.title.replace(MM, f"({unit_behind(unit).strip()})")
        return replace(self, title=title, low=factor * self.low, high=factor * self.high)


@dataclass(frozen=True, slots=True, eq=False)
class DisplaySurface:
    """Content of the 3D view for one frame. Sensor frame, x right and y down.

    Attributes
    ----------
    x_mm : (rows, columns) float32
        Nodes of each row, evenly spaced from one side of the working area to the other.
    y_mm : (rows,) float32
        Rows, evenly spaced.
    depth_mm : (rows, columns) float32
        Depth at the nodes.
    extent_mm : (left, top, right, bottom)
        Area that the texture covers.
    texture : (rows, columns, 3) uint8
        Colours, shaded.
    scale : ColourScale
        Meaning of the colours.
    range_mm : (low, high)
        Depths at the ends of the depth axis. Steady from frame to frame.
    curved : bool
        Whether it is the surface of a curved membrane itself, not its indentation.
    """

    x_mm: NDArray[np.float32]
    y_mm: NDArray[np.float32]
    depth_mm: NDArray[np.float32]
    extent_mm: tuple[float, float, float, float]
    texture: NDArray[np.uint8]
    scale: ColourScale
    range_mm: tuple[float, float]
    curved: bool

    @property
    def axis(self) -> tuple[float, str]:
        """Value of a depth of 1 on the upright axis, and the title of this axis."""
        return (-1.0, "height (mm)") if self.curved else (1.0, "depth (mm)")

    def thinned(self, largest: int) -> DisplaySurface:
        """Return it with at most this many nodes per side. The texture keeps its detail."""
        rows, columns = self.depth_mm.shape
        down = np.linspace(0, rows - 1, min(rows, largest)).round().astype(int)
        across = np.linspace(0, columns - 1, min(columns, largest)).round().astype(int)
        nodes = np.ix_(down, across)
        # Rows remain evenly spaced: rounded row numbers would distort the surface along y.
        y = np.linspace(self.y_mm[0], self.y_mm[-1], len(down), dtype=np.float32)
        return replace(self, x_mm=self.x_mm[nodes], y_mm=y, depth_mm=self.depth_mm[nodes])

    def depth_at(self, x_mm: NDArray[np.float64], y_mm: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the depth at points, linear between nodes, -inf off the surface."""
        rows, columns = self.depth_mm.shape
        row = (np.asarray(y_mm) - self.y_mm[0]) / (self.y_mm[-1] - self.y_mm[0]) * (rows - 1)
        upper = np.clip(np.floor(row), 0, rows - 2).astype(int)
        down = row - upper
        left, right = (
            self.x_mm[upper, end] * (1.0 - down) + self.x_mm[upper + 1, end] * down
            for end in (0, -1)
        )
        column = (np.asarray(x_mm) - left) / (right - left) * (columns - 1)
        first = np.clip(np.floor(column), 0, columns - 2).astype(int)
        across = column - first
        above, below = (
            self.depth_mm[r, first] * (1.0 - across) + self.depth_mm[r, first + 1] * across
            for r in (upper, upper + 1)
        )
        edge = 1e-6  # a node on the boundary belongs to the surface
        inside = (row >= -edge) & (row <= rows - 1 + edge)
        inside &= (column >= -edge) & (column <= columns - 1 + edge)
        return np.where(inside, above * (1.0 - down) + below * down, -np.inf)


@dataclass(frozen=True, slots=True)
class SurfaceLine:
    """A line that is drawn on the surface.

    Attributes
    ----------
    points_mm : tuple of (x, y)
        Its corners.
    colour : str
        Name or #rrggbb.
    """

    points_mm: tuple[tuple[float, float], ...]
    colour: str


def surface_of(
    heightmap: HeightMap,
    texture: NDArray[np.uint8],
    scale: ColourScale,
    *,
    range_mm: tuple[float, float],
    largest: int | None = None,
    depth_mm: NDArray[np.float32] | None = None,
) -> DisplaySurface | None:
    """Return the surface of a height map, or None if its working area is empty.

    Parameters
    ----------
    heightmap : HeightMap
        Its working area determines the edge of the surface.
    texture : (rows, columns, 3) uint8
        Colours over the whole grid.
    scale : ColourScale
        Meaning of the colours.
    range_mm : (low, high)
        Depths at the ends of the depth axis.
    largest : int, optional
        Maximum number of nodes per side. Default: all.
    depth_mm : (rows, columns), optional
        The depth averaged to fewer pixels, which is faster to sample.
    """
    depth = heightmap.depth_mm if depth_mm is None else depth_mm
    inside = heightmap.flags & Flag.OUTSIDE.value == 0
    used = np.flatnonzero(inside.any(axis=1))
    if used.size < 2:
        return None
    share = 1.0 if largest is None else min(largest / max(inside.shape), 1.0)
    rows = np.linspace(used[0], used[-1], max(round(share * used.size), 2))
    nearest = inside[np.rint(rows).astype(int)]
    first = nearest.argmax(axis=1)
    last = inside.shape[1] - 1 - nearest[:, ::-1].argmax(axis=1)
    last = np.maximum(last, first + 1)  # a row has at least two nodes
    columns = max(round(share * inside.shape[1]), 2)
    along = np.linspace(0.0, 1.0, columns)
    column = (first[:, None] + (last - first)[:, None] * along).astype(np.float32)
    row = np.repeat(rows[:, None], columns, axis=1).astype(np.float32)
    factor = depth.shape[1] / inside.shape[1]
    side = 2 * int(0.5 * factor / share) + 1
    smooth = cv2.blur(depth, (side, side)) if side > 1 else depth
    sampled = cv2.remap(
        smooth,
        (column + 0.5) * np.float32(factor) - np.float32(0.5),
        (row + 0.5) * np.float32(factor) - np.float32(0.5),
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    pitch, left, top = heightmap.pitch_mm, float(heightmap.x_mm[0]), float(heightmap.y_mm[0])
    half = 0.5 * pitch
    x_mm, y_mm = left + pitch * column, top + pitch * row
    if not heightmap.at_rest.flat:
        # The surface itself is drawn, not its indentation.
        rest_mm = heightmap.at_rest.height(np.stack([x_mm, y_mm], axis=-1))
        sampled, range_mm = sampled - rest_mm, (range_mm[0] - float(rest_mm.max()), range_mm[1])
    return DisplaySurface(
        x_mm=x_mm.astype(np.float32),
        y_mm=y_mm[:, 0].astype(np.float32),
        depth_mm=np.asarray(sampled, np.float32),
        extent_mm=(
            left - half,
            top - half,
            float(heightmap.x_mm[-1]) + half,
            float(heightmap.y_mm[-1]) + half,
        ),
        texture=texture,
        scale=scale,
        range_mm=range_mm,
        curved=not heightmap.at_rest.flat,
    )
