"""Visibility on the membrane: the point that a ray meets and the visible share of a lamp.

Both march over the depth map itself, so hidden walls, perspective and cast shadows follow from the
geometry without approximation.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from gelpolight_core.base.arrays import Float64Array

from .pressed_surface import TILE
from .simulation_kernel import compiled

_SHADOW_STEP = 0.7
"""Step of the march towards a lamp in cells: below one, so that no ridge is skipped."""


@compiled
def sample(values: Any, column: float, row: float) -> float:  # pragma: no cover - compiled
    """Return the bilinear value at a fractional cell, 0 outside the grid."""
    rows, columns = values.shape
    if not (0.0 <= column <= columns - 1.0 and 0.0 <= row <= rows - 1.0):
        return 0.0
    i, j = min(int(row), rows - 2), min(int(column), columns - 2)
    a, b = row - i, column - j
    top = values[i, j] + b * (values[i, j + 1] - values[i, j])
    bottom = values[i + 1, j] + b * (values[i + 1, j + 1] - values[i + 1, j])
    return float(top + a * (bottom - top))


@compiled
def tile_range(
    tile_max: Any, tile_min: Any, first: Any, last: Any
) -> tuple[float, float]:  # pragma: no cover - compiled
    """Return the highest and lowest depth over the tiles between two cells (column, row)."""
    rows, columns = tile_max.shape
    high, low = 0.0, 1e300
    j0 = math.floor(min(first[0], last[0]) / TILE)
    j1 = math.floor(max(first[0], last[0]) / TILE)
    i0 = math.floor(min(first[1], last[1]) / TILE)
    i1 = math.floor(max(first[1], last[1]) / TILE)
    for i in range(i0, i1 + 1):
        for j in range(j0, j1 + 1):
            if 0 <= i < rows and 0 <= j < columns:
                high, low = max(high, tile_max[i, j]), min(low, tile_min[i, j])
            else:
                low = 0.0
    return high, min(low, high)


@compiled
def visible_depth(
    depth: Any, tile_max: Any, tile_min: Any, deepest: float, cell: Any, move: Any
) -> float:  # pragma: no cover - compiled
    """Return the depth at which the ray of a pixel first meets the membrane.

    Parameters
    ----------
    depth, tile_max, tile_min : arrays
        Maps of the :class:`PressedSurface`.
    deepest : float
        Greatest depth of the whole surface.
    cell : (column, row)
        Intersection of the ray with the undeformed surface.
    move : (columns, rows)
        Lateral shift of the ray per mm of depth.
    """
    end = (cell[0] + deepest * move[0], cell[1] + deepest * move[1])
    high, low = tile_range(tile_max, tile_min, cell, end)
    if high - low < 1e-12:
        return high
    sideways = math.hypot(move[0], move[1])
    count = max(1, math.ceil((high - low) * sideways))
    step = (high - low) / count
    above, below, f_above, f_below = high, low, 0.0, 0.0
    # From the camera's side towards the membrane: the camera sees the first crossing.
    for number in range(count + 1):
        d = high - number * step
        f = d - sample(depth, cell[0] + d * move[0], cell[1] + d * move[1])
        if f <= 0.0:
            below, f_below = d, f
            break
        above, f_above = d, f
    if below >= above:
        return below
    for number in range(30):
        if above - below < 1e-9:
            break
        d = 0.5 * (above + below)
        # Regula falsi is exact where the surface is flat; the guard prevents slow convergence.
        guess = below - f_below * (above - below) / (f_above - f_below)
        if number < 6 and above > guess > below:
            d = guess
        f = d - sample(depth, cell[0] + d * move[0], cell[1] + d * move[1])
        if f > 0.0:
            above, f_above = d, f
        else:
            below, f_below = d, f
        if abs(f) < 1e-10:
            return d
    return 0.5 * (above + below)


@compiled
def steepest_horizon(
    depth: Any, tile_max: Any, deepest: float, cell: Any, d: float, direction: Any, rise: float
) -> float:  # pragma: no cover - compiled
    """Return the steepest slope, per cell, of the obstacles between a point and a lamp.

    Parameters
    ----------
    depth, tile_max, deepest
        Maps of the :class:`PressedSurface`.
    cell : (column, row)
        The point.
    d : float
        Its depth in mm.
    direction : (columns, rows)
        Unit direction to the foot of the lamp, in cells.
    rise : float
        Depth that a ray to the lamp's highest point gains per cell.
    """
    steepest = -1e300
    along = 1.0
    rows, columns = tile_max.shape
    while d + rise * along < deepest:
        x, y = cell[0] + direction[0] * along, cell[1] + direction[1] * along
        j, i = math.floor(x / TILE), math.floor(y / TILE)
        if not (0 <= i < rows and 0 <= j < columns):
            break
        if tile_max[i, j] - d > along * max(rise, steepest):
            slope = (sample(depth, x, y) - d) / along
            steepest = max(steepest, slope)
            along += _SHADOW_STEP
        else:
            along += tile_exit(x, y, direction, i, j)
    return steepest


@compiled
def tile_exit(
    x: float, y: float, direction: Any, i: int, j: int
) -> float:  # pragma: no cover - compiled
    """Return the distance along `direction` to leave tile (i, j)."""
    far = 1e300
    if direction[0] > 1e-12:
        far = min(far, ((j + 1) * TILE - x) / direction[0])
    elif direction[0] < -1e-12:
        far = min(far, (j * TILE - x) / direction[0])
    if direction[1] > 1e-12:
        far = min(far, ((i + 1) * TILE - y) / direction[1])
    elif direction[1] < -1e-12:
        far = min(far, (i * TILE - y) / direction[1])
    return far + 1e-6


@compiled
def disc_share(offset: float) -> float:  # pragma: no cover - compiled
    """Return the share of a unit disc on the near side of a line at `offset` from its centre."""
    if offset >= 1.0:
        return 1.0
    if offset <= -1.0:
        return 0.0
    return 0.5 + (offset * math.sqrt(1.0 - offset * offset) + math.asin(offset)) / math.pi


@compiled
def lamp_share(
    depth: Any, tile_max: Any, grid: Any, point: Any, lamp: Any
) -> float:  # pragma: no cover - compiled
    """Return the share of a lamp's disc that a point of the membrane sees, 0..1.

    Parameters
    ----------
    depth, tile_max
        Maps of the :class:`PressedSurface`.
    grid : (x0_mm, y0_mm, pitch_mm, deepest_mm)
        Position of the depth map.
    point : (x_mm, y_mm, depth_mm)
        The point.
    lamp : (11,)
        A row of the lamp table.
    """
    x0, y0, pitch, deepest = grid
    d = point[2]
    if d >= deepest:
        return 1.0
    dx, dy = lamp[0] - point[0], lamp[1] - point[1]
    lamp_distance, rise_mm, radius = math.hypot(dx, dy), -lamp[2] - d, lamp[5]
    if rise_mm <= 0.0:
        return 0.0
    if lamp_distance < 1e-9:
        return 1.0
    direction = (dx / lamp_distance, dy / lamp_distance)
    cell = ((point[0] - x0) / pitch, (point[1] - y0) / pitch)
    slope = rise_mm / (lamp_distance + radius)
    steepest = steepest_horizon(depth, tile_max, deepest, cell, d, direction, slope * pitch) / pitch
    if steepest <= slope:
        return 1.0
    # The horizon cuts the lamp's plane at this distance; everything beyond is hidden.
    cut = rise_mm / steepest
    if radius <= 0.0:
        return 0.0 if cut < lamp_distance else 1.0
    return disc_share((cut - lamp_distance) / radius)


@compiled
def _sample_all(values: Any, column: Any, row: Any) -> Any:  # pragma: no cover - compiled
    out = np.zeros(column.shape)
    for i in range(column.shape[0]):
        for j in range(column.shape[1]):
            out[i, j] = sample(values, column[i, j], row[i, j])
    return out


def sample_all(values: Float64Array, column: Float64Array, row: Float64Array) -> Float64Array:
    """Return bilinear values at fractional cells (rows, columns), 0 outside the grid."""
    return np.asarray(_sample_all(values, column, row))
