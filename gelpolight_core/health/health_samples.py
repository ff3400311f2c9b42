"""The sample points of the health check, with their expected values.

The field is divided into cells of about a millimetre. In each, a few short runs of grid nodes are
sampled from the raw frame, by the same interpolation as the background was. The effects of a change
of light, room light, shift and blur are computed from the background beforehand, so that the
least-squares sums of each cell need only one pass over the samples.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import BoolArray, Float32Array, Float64Array, Int32Array
from gelpolight_core.base.compiling import whole
from gelpolight_core.base.membrane_masks import SATURATED, lit_mask
from gelpolight_core.geometry.resampling import ResamplingTable
from gelpolight_core.image.grain import block_corners

from .background_reference import BackgroundReference

CELL_MM = 1.15
CELL_NODES = 10
"""Least width of a cell in nodes."""
CELLS_ACROSS = 8
"""Least number of cells across the field, also where a wrong scale makes it look small."""
RUN = 8
"""Neighbouring nodes that are sampled together: they share the camera's rows."""
RUNS_OF_CELL = 4
SMOOTH_NODES = 1.5
"""Smoothing for the roughness of the background."""
FINE_NODES = 0.5
"""Smoothing for its slopes: with a larger one, the shift of specks would be overestimated."""
BROAD_NODES = 6.0
"""Smoothing for the slopes of the light without texture."""
TEXTURE = 20.0
"""A run can show a blur if it is rougher than most by this factor, because noise is rough, too."""
BLURS_PX = (0.5, 1.0, 2.0, 4.0, 8.0)
"""Blurs (standard deviation) applied to the background to compute their effect."""
LEAST_NOISE = 0.4 / 255.0
"""Rounding to 8 bits alone is noise of 0.3 steps."""
ROUGH = 0.02
"""Error of interpolation as a share of the change of light from pixel to pixel."""
PARAMETERS = 9
"""Gain and offset of each channel; shift along u, along v; blur."""
SHIFT_U, SHIFT_V, BLUR = 6, 7, 8


@dataclass(frozen=True, slots=True)
class HealthSamples:
    """Sampled pixels of the background, with the effects of faults on them (N: `RUN` for each run).

    Attributes
    ----------
    corner : (N, 2) int32
        Raw row and column of the first of four pixels around each sample.
    part : (N, 2) float32
        How far it is from there, in rows and columns.
    expected : (N, 3) float32
        Linear light of the untouched membrane.
    effects : (N, 3, 5) float32
        Change of the light by gain, offset, shift along u and v, and blur of strength 1, over its
        variance.
    weight : (N, 3) float32
        1 over the variance.
    normal : (cells, PARAMETERS, PARAMETERS) float64
        Sums of products of the effects.
    by_gain : (cells, 3) float64
        Its diagonal for the gains.
    count : (cells,) float64
        Samples of each cell.
    run_light : (3, runs) float64
        Sum of the expected light.
    beside : (cells, 8) int32
        Neighbours of each cell; itself where there is none.
    run_cell : (runs,) int32
        Cell of each run.
    shapes : (cells, 6) float64
        The smooth shapes of :func:`image_shapes` at the cells.
    place_mm, cell_light : (cells, 2), (cells, 3) float64
        Their middles on the membrane, x and y, and their mean light.
    blocks : (cells, 2) int32
        Where the grain of the image is measured, as for
        :func:`~gelpolight_core.image.grain.block_grain`.
    blur_strength : (1 + blurs,) float64
        Result of the blur fit for no blur and for `BLURS_PX`; empty if the membrane has too little
        texture.
    """

    corner: Int32Array
    part: Float32Array
    expected: Float32Array
    effects: Float32Array
    weight: Float32Array
    normal: Float64Array
    by_gain: Float64Array
    count: Float64Array
    run_light: Float64Array
    beside: Int32Array
    run_cell: Int32Array
    shapes: Float64Array
    place_mm: Float64Array
    cell_light: Float64Array
    blocks: Int32Array
    blur_strength: Float64Array


def choose_samples(calibration: BackgroundReference) -> HealthSamples:
    """Choose the samples of a calibrated sensor."""
    base, table = calibration.background, calibration.table
    inside = table.valid & lit_mask(base) & (base < SATURATED).all(axis=2)
    reach = int(np.ceil(3.0 * SMOOTH_NODES)) + 1
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
    core = cv2.erode(inside.astype(np.uint8), disc, borderValue=0) > 0
    smooth = np.asarray(cv2.GaussianBlur(base, (0, 0), SMOOTH_NODES), np.float32)
    rough = np.asarray(cv2.Laplacian(smooth, cv2.CV_32F, ksize=1), np.float32)
    row, first, cell, textured = _runs(
        core, np.asarray(rough / np.maximum(smooth, np.float32(1e-3)), np.float32), table
    )
    rows = np.repeat(row, RUN)
    columns = (first[:, None] + np.arange(RUN)).ravel()
    noise = np.maximum(calibration.noise, LEAST_NOISE)
    by_u, by_v = _per_pixel(_known_slopes(base, noise), rows, columns, table)
    expected = base[rows, columns]
    by_blur = np.where(np.repeat(textured, RUN)[:, None], rough[rows, columns], 0.0)
    median = np.maximum(np.median(expected, axis=0), 1e-3) if rows.size else np.ones(3)
    # Read noise and shot noise; stated at the median brightness.
    variance = noise**2 * (0.3 + 0.7 * expected / median)
    variance += ROUGH**2 * (by_u**2 + by_v**2)
    weight = (1.0 / variance).astype(np.float32)
    plain = np.stack([expected, np.ones_like(expected), -by_u, -by_v, by_blur], -1)
    used, lattice = np.unique(cell, return_inverse=True)
    u, v = table.u_px[rows, columns], table.v_px[rows, columns]
    camera = calibration.camera
    down = np.clip(v.astype(np.int32), 0, camera.height - 2)
    corner = np.stack([down, np.clip(u.astype(np.int32), 0, camera.width - 2)], axis=-1)
    of_sample = np.repeat(lattice.astype(np.int32), RUN)
    across = core.shape[1] // _cell_nodes(table) + 1
    count = np.bincount(of_sample, minlength=used.size).astype(np.float64)

    def mean(values: NDArray[np.floating[Any] | np.integer[Any]]) -> Float64Array:
        columns = [np.bincount(of_sample, part, used.size) / count for part in values.T]
        return np.stack(columns, axis=-1)

    middle = mean(corner)
    normal = _normal(plain.astype(np.float64), weight, of_sample, used.size)
    return HealthSamples(
        corner=np.ascontiguousarray(corner, np.int32),
        part=np.ascontiguousarray(np.stack([v, u], -1) - corner, np.float32),
        expected=np.ascontiguousarray(expected, np.float32),
        effects=np.ascontiguousarray(plain * weight[..., None], np.float32),
        weight=weight,
        normal=normal,
        by_gain=normal[:, [0, 2, 4], [0, 2, 4]],
        count=count,
        run_light=np.ascontiguousarray(expected.reshape(-1, RUN, 3).sum(axis=1).T, np.float64),
        beside=_neighbours(used, across),
        run_cell=lattice.astype(np.int32),
        shapes=image_shapes(middle[:, 0], middle[:, 1], camera.height, camera.width),
        place_mm=mean(np.stack([table.grid.x_mm[columns], table.grid.y_mm[rows]], axis=-1)),
        cell_light=mean(expected),
        blocks=block_corners(middle, camera.height, camera.width),
        blur_strength=_blur_strength(base, (rows, columns), by_blur, weight)
        if textured.any()
        else np.zeros(0),
    )


def _known_slopes(base: Float32Array, noise: Float64Array) -> Float32Array:
    """Return the background with as much texture as its noise lets one see.

    The slopes of noise do not move with the membrane.
    """
    fine = cv2.GaussianBlur(base, (0, 0), FINE_NODES)
    broad = cv2.GaussianBlur(base, (0, 0), BROAD_NODES)
    texture = fine - broad
    side = 2 * math.ceil(BROAD_NODES) + 1
    seen = cv2.blur(texture**2, (side, side))
    # A Gaussian leaves this part of the variance of white noise.
    of_noise = (noise / (2.0 * FINE_NODES)) ** 2 / np.pi
    # Among many squares of 28 independent values, some have twice the variance of noise.
    known = seen > 2.0 * of_noise
    share = np.where(known, 1.0 - of_noise / np.maximum(seen, np.finfo(np.float32).tiny), 0.0)
    return np.asarray(broad + texture * share, np.float32)


def image_shapes(row: Float64Array, column: Float64Array, height: int, width: int) -> Float64Array:
    """Return the smooth shapes (..., 6) of light over an image: constant, linear, quadratic."""
    half = 0.5 * max(height, width)
    y, x = (row - 0.5 * (height - 1)) / half, (column - 0.5 * (width - 1)) / half
    return np.stack(np.broadcast_arrays(np.ones(1), x, y, x * x, x * y, y * y), axis=-1)


def light_over_image(shape: Float64Array, height: int, width: int) -> Float32Array:
    """Return 1 plus a sum of the shapes of :func:`image_shapes` at every pixel."""
    half = 0.5 * max(height, width)
    y = ((np.arange(height) - 0.5 * (height - 1)) / half)[:, None]
    x = (np.arange(width) - 0.5 * (width - 1)) / half
    first, by_x, by_y, by_xx, by_xy, by_yy = shape.tolist()
    along = 1.0 + first + by_x * x + by_xx * x * x
    return np.asarray(along + by_y * y + by_yy * y * y + by_xy * x * y, np.float32)


def _blur_strength(
    base: Float32Array,
    nodes: tuple[NDArray[np.intp], NDArray[np.intp]],
    by_blur: Float64Array,
    weight: Float32Array,
) -> Float64Array:
    """Return `HealthSamples.blur_strength`, by the green channel."""
    green, effect = base[..., 1], by_blur[:, 1]
    size = float((weight[:, 1] * effect**2).sum())
    strengths = [0.0]
    for sigma in BLURS_PX:
        change = cv2.GaussianBlur(green, (0, 0), sigma)[nodes] - green[nodes]
        strengths.append(float((weight[:, 1] * effect * change).sum()) / size)
    return np.maximum.accumulate(strengths)


def _neighbours(used: NDArray[np.intp], across: int) -> Int32Array:
    """Return the indices (cells, 8) of the cells around each."""
    steps = [i * across + j for i in (-1, 0, 1) for j in (-1, 0, 1) if (i, j) != (0, 0)]
    neighbours = used[:, None] + np.array(steps)
    at = np.clip(np.searchsorted(used, neighbours), 0, max(used.size - 1, 0))
    cells = np.broadcast_to(np.arange(used.size)[:, None], neighbours.shape)
    return np.asarray(np.where(used[at] == neighbours, at, cells), np.int32)


def _cell_nodes(table: ResamplingTable) -> int:
    widest = int(min(table.u_px.shape)) // CELLS_ACROSS
    return max(min(round(CELL_MM / table.grid.pitch_mm), widest), CELL_NODES)


def _runs(
    core: BoolArray, rough: Float32Array, table: ResamplingTable
) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.intp], BoolArray]:
    """Return row, first column, cell and texture of the runs, by cell.

    One run of each cell is at the strongest texture, which shows shift and blur; the others are
    anywhere.
    """
    size, (rows, columns) = _cell_nodes(table), core.shape
    blocks = columns // RUN
    cut = np.s_[:, : blocks * RUN]
    whole = core[cut].reshape(rows, blocks, RUN).all(axis=2)
    energy = (rough[cut] ** 2).sum(axis=2).reshape(rows, blocks, RUN).sum(axis=2)
    row, block = np.nonzero(whole)
    across = columns // size + 1
    cell = (row // size) * across + (block * RUN + RUN // 2) // size
    chance = np.random.default_rng(0).random(row.size)
    rank = np.empty(row.size, np.intp)
    order = np.lexsort((-energy[row, block], cell))
    starts = np.r_[True, np.diff(cell[order]) != 0] if row.size else np.zeros(0, bool)
    chance[order[starts]] = -1.0
    order = np.lexsort((chance, cell))
    starts = np.flatnonzero(np.r_[True, np.diff(cell[order]) != 0]) if row.size else order
    lengths = np.diff(np.r_[starts, row.size])
    rank[order] = np.arange(row.size) - np.repeat(starts, lengths)
    # A cell with fewer runs lies at the boundary.
    few = np.repeat(lengths < RUNS_OF_CELL, lengths)
    keep = order[(rank[order] < RUNS_OF_CELL) & ~few]
    row, block, cell = row[keep], block[keep], cell[keep]
    textured = energy[row, block] > TEXTURE * np.median(energy[whole]) if row.size else row > 0
    if textured.sum() < 8:
        textured[:] = False
    return row, block * RUN, cell, textured


def _per_pixel(
    smooth: Float32Array, rows: NDArray[np.intp], columns: NDArray[np.intp], table: ResamplingTable
) -> tuple[Float64Array, Float64Array]:
    """Return the change (N, 3) of the background from one raw pixel to the next, along u and v."""

    def steps(values: Float32Array) -> tuple[Float32Array, Float32Array]:
        along = 0.5 * (values[rows, columns + 1] - values[rows, columns - 1])
        down = 0.5 * (values[rows + 1, columns] - values[rows - 1, columns])
        return along, down

    (u_x, u_y), (v_x, v_y) = steps(table.u_px), steps(table.v_px)
    light_x, light_y = steps(smooth)
    area = (u_x * v_y - u_y * v_x)[:, None]
    by_u = (light_x * v_y[:, None] - light_y * v_x[:, None]) / area
    by_v = (light_y * u_x[:, None] - light_x * u_y[:, None]) / area
    return np.asarray(by_u, np.float64), np.asarray(by_v, np.float64)


def _normal(
    plain: Float64Array, weight: Float32Array, cell: Int32Array, cells: int
) -> Float64Array:
    normal = np.zeros((cells, PARAMETERS, PARAMETERS))
    for k in range(3):
        at = [2 * k, 2 * k + 1, SHIFT_U, SHIFT_V, BLUR]
        for i, to in enumerate(at):
            for j, other in enumerate(at):
                products = weight[:, k] * plain[:, k, i] * plain[:, k, j]
                normal[:, to, other] += np.bincount(cell, products, minlength=cells)
    return normal


@whole(fastmath=True)
def compare_samples(  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    raw,
    light,
    limit,
    corner,
    part,
    run_cell,
    expected,
    effects,
    weight,
    change,
    square,
    full,
    run_change,
):
    """Sum up a frame less what is expected, in one pass.

    Parameters
    ----------
    raw : (height, width, 3) uint8 or uint16
        The frame.
    light : (3, levels) float32
        Linear light of every number.
    limit : float
        Light above which a channel is saturated.
    corner, part, run_cell, expected, effects, weight
        Parts of :class:`HealthSamples`.
    change : (cells, PARAMETERS) float64
        Sums of products of the difference and the effects; written.
    square : (cells,) float64
        Sums of squares of the difference over its variance; written.
    full : (cells,) float64
        Samples with a saturated channel; written.
    run_change : (3, runs) float64
        Sums of the difference; written.
    """
    change[:], square[:], full[:] = 0.0, 0.0, 0.0
    zero = np.float32(0.0)
    topped = np.empty(RUN, np.bool_)
    for run in range(run_cell.size):
        at, first = run_cell[run], run * RUN
        topped[:] = False
        squares = zero
        for k in range(3):
            gain, offset, by_u, by_v, blur, total = zero, zero, zero, zero, zero, zero
            for i in range(RUN):
                n = first + i
                r, c, fv, fu = corner[n, 0], corner[n, 1], part[n, 0], part[n, 1]
                p00, p01 = light[k, raw[r, c, k]], light[k, raw[r, c + 1, k]]
                p10, p11 = light[k, raw[r + 1, c, k]], light[k, raw[r + 1, c + 1, k]]
                upper, lower = p00 + fu * (p01 - p00), p10 + fu * (p11 - p10)
                topped[i] |= max(max(p00, p01), max(p10, p11)) >= limit
                off = upper + fv * (lower - upper) - expected[n, k]
                gain += off * effects[n, k, 0]
                offset += off * effects[n, k, 1]
                by_u += off * effects[n, k, 2]
                by_v += off * effects[n, k, 3]
                blur += off * effects[n, k, 4]
                squares += off * off * weight[n, k]
                total += off
            change[at, 2 * k] += gain
            change[at, 2 * k + 1] += offset
            change[at, SHIFT_U] += by_u
            change[at, SHIFT_V] += by_v
            change[at, BLUR] += blur
            run_change[k, run] = total
        square[at] += squares
        for i in range(RUN):
            full[at] += topped[i]
