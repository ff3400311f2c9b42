"""Bring a solved region to true positions on the whole grid."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array
from gelpolight_core.base.row_threads import RowThreadPool
from gelpolight_core.reconstruction.compiled import BLOCK, HALF, ONE, ZERO, part, single, whole
from gelpolight_core.reconstruction.height_map import COARSE, Flag

from .kernel import ray_ramps
from .region_solution import SolvedRegion


def place_region(
    solved: SolvedRegion,
    kind: NDArray[np.uint8],
    result: tuple[Float32Array, NDArray[np.uint8], Float32Array | None],
    workers: RowThreadPool,
    take: Callable[..., NDArray[Any]],
    *,
    true_positions: bool,
) -> None:
    """Write a solved region to the whole grid, and the ray of each position to it.

    Parameters
    ----------
    solved : SolvedRegion
        The region. Its `position` is written.
    kind : (rows, columns) uint8
        `PyramidLevel.kind` of the whole grid at full scale.
    result : depth (rows, columns), flags (rows, columns), normals (rows, columns, 3) or None
        Maps of the whole grid. The region is written.
    workers : RowThreadPool
        Threads for blocks of rows.
    take : callable
        Lends work arrays.
    true_positions : bool
        Whether depths are moved to the points that their rays see.
    """
    depth, flags, normals = result
    scale, slopes, position = solved.scale, solved.slopes, solved.position
    corner, shape = solved.region.at(COARSE // scale.factor)
    placed, marks = take("placed", shape), take("marks", shape, np.uint8)
    workers.run(
        shape[0],
        place_rows,
        solved.depth_mm,
        scale,
        corner,
        true_positions,
        slopes.flags,
        int(Flag.NOT_OBSERVABLE),
        placed,
        marks,
        position,
    )
    if scale.rest is not None:
        rest = scale.rest[0][solved.region.window(COARSE // scale.factor)]
        # Depth along z at a place is not that along the ray that sees it.
        placed += rest - cv2.remap(rest, position[0], position[1], cv2.INTER_LINEAR)
    first, (rows, _) = solved.region.at(COARSE)
    outside, factor = int(Flag.OUTSIDE), scale.factor
    workers.run(rows, resample_depth, placed, marks, factor, first, outside, kind, depth, flags)
    if normals is not None:
        facing = slopes.normal_x, slopes.normal_y
        workers.run(rows, resample_normals, *facing, position, factor, first, normals)


@part
def _between(values, c, r, fc, fr):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    top = values[r, c] + fc * (values[r, c + 1] - values[r, c])
    low = values[r + 1, c] + fc * (values[r + 1, c + 1] - values[r + 1, c])
    return (
        top + fr * (low - top),
        (values[r, c + 1] - values[r, c]) * (ONE - fr)
        + (values[r + 1, c + 1] - values[r + 1, c]) * fr,
        low - top,
    )


@whole
def place_rows(  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    first, last, depth, scale, corner, true_positions, flags, hidden, placed, marks, position
):
    """Find the ray that sees each true position, and the depth there.

    The ray of node j sees the surface at j + depth * ray slope: Newton's steps on the bilinear
    depth, and half steps of the fixed point where the surface folds.

    Parameters
    ----------
    depth, flags : (rows, columns)
        At each node's ray, in a region of `scale` whose first node is `corner`.
    true_positions : bool
        Else every position is seen by its own ray.
    hidden : int
        Flag of positions that no ray sees.
    placed, marks : (rows, columns)
        Depth and flags at the true positions, written.
    position : (2, rows, columns)
        Column and row of the ray that sees each position, written.
    """
    rows, columns = depth.shape
    per_pitch = ONE / single(scale.pitch_mm)
    if not true_positions:
        per_pitch = ZERO
    for i in range(first, last):
        for begin in range(0, columns, BLOCK):
            count = min(BLOCK, columns - begin)
            ramps = ray_ramps(scale, i + corner[0], begin + corner[1], count)
            for j in range(begin, begin + count):
                at = single(j - begin)
                wx = (ramps[0] + at * ramps[1]) * per_pitch
                wy = (ramps[2] + at * ramps[3]) * per_pitch
                wxx, wyx = ramps[4] + at * ramps[5], ramps[6] + at * ramps[7]
                wxy, wyy = ramps[8] + at * ramps[9], ramps[10] + at * ramps[11]
                d = depth[i, j]
                c, r = single(j), single(i)
                x, y = c - d * wx, r - d * wy
                missed = ZERO
                n, m = j, i
                for step in range(14):
                    x = min(max(x, ZERO), single(columns - 1))
                    y = min(max(y, ZERO), single(rows - 1))
                    n, m = min(int(x), columns - 2), min(int(y), rows - 2)
                    d, by_x, by_y = _between(depth, n, m, x - single(n), y - single(m))
                    off_x, off_y = x - c, y - r
                    ex = off_x + d * (wx + wxx * off_x + wxy * off_y)
                    ey = off_y + d * (wy + wyx * off_x + wyy * off_y)
                    missed = max(abs(ex), abs(ey))
                    if missed < 0.01:
                        break
                    det = ONE + by_x * wx + by_y * wy
                    if step < 5 and det > single(0.3):
                        along = (by_x * ex + by_y * ey) / det
                        x -= ex - along * wx
                        y -= ey - along * wy
                    else:
                        x -= HALF * ex
                        y -= HALF * ey
                placed[i, j] = d
                near = flags[min(int(y + HALF), rows - 1), min(int(x + HALF), columns - 1)]
                marks[i, j] = near | (hidden if missed > 0.55 else 0)
                position[0, i, j], position[1, i, j] = x, y


@whole
def resample_depth(first, last, placed, placed_flags, factor, corner, outside, kind, depth, flags):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Bring depth and flags from a coarser region to rows of the whole grid, bilinear.

    Depth is 0 outside the field. In holes of the field it is what the solve filled in from around.
    """
    rows, columns = placed.shape
    line = np.empty(columns, np.float32)
    share = ONE / single(factor)
    for i in range(first, last):
        y = (single(i) + HALF) * share - HALF
        m = min(max(int(np.floor(y)), 0), rows - 1)
        m1 = min(m + 1, rows - 1)
        f = min(max(y - single(m), ZERO), ONE)
        a, b = placed[m], placed[m1]
        for j in range(columns):
            line[j] = a[j] + f * (b[j] - a[j])
        marks, source = flags[corner[0] + i], placed_flags[i // factor]
        out, kinds = depth[corner[0] + i], kind[corner[0] + i]
        for n in range(columns):
            before, after = line[max(n - 1, 0)], line[min(n + 1, columns - 1)]
            middle = line[n]
            mark = source[n] & ~outside
            for k in range(factor):
                at = corner[1] + n * factor + k
                t = (single(k) + HALF) * share - HALF
                value = middle + t * (after - middle) if t > 0.0 else middle + t * (middle - before)
                out[at] = value if kinds[at] > 0 else ZERO
                marks[at] = marks[at] | mark


@whole
def resample_normals(first, last, normal_x, normal_y, position, factor, corner, normals):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Bring normals to their true positions on rows of the whole grid."""
    rows, columns = normal_x.shape
    share = ONE / single(factor)
    for i in range(first, last):
        y = min(max((single(i) + HALF) * share - HALF, ZERO), single(rows - 1))
        m = min(int(y), rows - 2)
        for j in range(columns * factor):
            x = min(max((single(j) + HALF) * share - HALF, ZERO), single(columns - 1))
            n = min(int(x), columns - 2)
            u = _between(position[0], n, m, x - single(n), y - single(m))[0]
            v = _between(position[1], n, m, x - single(n), y - single(m))[0]
            c, r = min(int(u), columns - 2), min(int(v), rows - 2)
            nx = _between(normal_x, c, r, u - single(c), v - single(r))[0]
            ny = _between(normal_y, c, r, u - single(c), v - single(r))[0]
            to = normals[corner[0] + i, corner[1] + j]
            to[0], to[1] = nx, ny
            to[2] = -np.sqrt(max(ONE - nx * nx - ny * ny, ZERO))
