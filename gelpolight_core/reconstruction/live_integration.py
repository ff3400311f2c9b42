"""Weighted integration for the planned reconstruction: as `weighted`, in few compiled passes."""

from __future__ import annotations

from dataclasses import dataclass

import numba
import numpy as np
import scipy.fft
from numpy.typing import NDArray

from gelpolight_core.reconstruction.column_solve import settled_rows, solve_columns
from gelpolight_core.reconstruction.threads import RowWorkers
from gelpolight_core.reconstruction.weighted import MAX_ROUNDS

Map = NDArray[np.float32]
SHARED_NODES = 60_000


_whole = numba.njit(nogil=True, fastmath={"nsz", "arcp", "contract", "reassoc"}, cache=True)
_single = np.float32
_0, _HALF, _1 = _single(0.0), _single(0.5), _single(1.0)
_13, _PART = _single(13.0), _single(1.0 / 24.0)


@dataclass(frozen=True, slots=True)
class LiveIntegration:
    """Depth from weighted slopes.

    Attributes
    ----------
    depth_mm : (rows, columns) float32
        At the nodes.
    rounds : int
        Of the conjugate gradients.
    """

    depth_mm: Map
    rounds: int


def integrate_live(
    slope_x: Map,
    slope_y: Map,
    weight: Map,
    *,
    pitch_mm: float,
    start_mm: Map | None,
    hold: Map | None,
    tolerance: float,
    workers: RowWorkers,
) -> LiveIntegration:
    """Integrate slopes (rows, columns) as :func:`integrate_weighted` does.

    Parameters
    ----------
    slope_x, slope_y, weight, pitch_mm, start_mm, hold
        As there; `hold` None: depth 0 is held all around.
    tolerance : float
        Of what is left, relative to the depth itself, in the root of the mean squared weighted
        slope: no transform is spent on finding out.
    workers : RowWorkers
        Threads.
    """
    shape = weight.shape
    firm = np.full(2 * sum(shape), 2.0, np.float32)
    if hold is not None:
        edges = (hold[0], hold[-1], hold[:, 0], hold[:, -1])
        firm = np.concatenate(edges).astype(np.float32) * np.float32(2.0)
    waves = 2.0 - 2.0 * np.cos(np.pi * np.arange(1, shape[1] + 1) / shape[1])
    settled = settled_rows(waves, shape[0], weight.dtype)
    blocks = settled.size
    # A small transform is done before a second thread has woken.
    threads = workers.count if weight.size > SHARED_NODES else 1

    def precondition(field: Map) -> Map:
        spectrum = scipy.fft.dst(field, type=2, axis=1, workers=threads)
        if threads > 1:
            workers.run(blocks, solve_columns, spectrum, waves, settled, 1.0)
        else:
            solve_columns(0, blocks, spectrum, waves, settled, 1.0)
        return np.asarray(
            scipy.fft.idst(spectrum, type=2, axis=1, workers=threads, overwrite_x=True)
        )

    left = np.empty(shape, np.float32)
    _flow(slope_x, slope_y, weight, np.float32(pitch_mm), left)
    depth = np.zeros(shape, np.float32) if start_mm is None else np.array(start_mm, np.float32)
    image = np.empty(shape, np.float32)
    energy = 0.0
    if start_mm is not None:
        energy = _apply(depth, weight, firm, image)
        left -= image
    direction = better = precondition(left)
    size = _dot(left, better)
    wanted = tolerance**2 * max(energy, size)
    rounds = 0
    while size > wanted and rounds < MAX_ROUNDS:
        along = _apply(direction, weight, firm, image)
        _advance(np.float32(size / along), direction, image, depth, left)
        rounds += 1
        if rounds == MAX_ROUNDS:
            break
        better = precondition(left)
        fresh = _dot(left, better)
        _turn(np.float32(fresh / size), better, direction)
        size = fresh
    return LiveIntegration(depth, rounds)


@_whole
def _dot(a, b):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    total = np.float64(0.0)
    for i in range(a.shape[0]):
        p, q = a[i], b[i]
        part = np.float32(0.0)
        for j in range(p.shape[0]):
            part += p[j] * q[j]
        total += part
    return total


@_whole
def _advance(step, direction, image, depth, left):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    for i in range(depth.shape[0]):
        p, q, d, e = direction[i], image[i], depth[i], left[i]
        for j in range(p.shape[0]):
            d[j] += step * p[j]
        for j in range(p.shape[0]):
            e[j] -= step * q[j]


@_whole
def _turn(share, better, direction):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    for i in range(better.shape[0]):
        p, q = direction[i], better[i]
        for j in range(p.shape[0]):
            p[j] = share * p[j] + q[j]


@_whole
def _flow(slope_x, slope_y, weight, pitch, out):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Write what the weighted edge integrals of the slopes bring to each node."""
    rows, columns = weight.shape
    edge = np.empty(columns, np.float32)
    out[:] = _0
    for i in range(rows):
        s, w, target = slope_x[i], weight[i], out[i]
        for j in range(columns - 1):
            edge[j] = _HALF * (s[j] + s[j + 1])
        for j in range(1, columns - 2):
            edge[j] = (_13 * (s[j] + s[j + 1]) - s[j - 1] - s[j + 2]) * _PART
        for j in range(columns - 1):
            edge[j] = edge[j] * pitch * (w[j] if w[j] < w[j + 1] else w[j + 1])
        for j in range(columns - 1):
            target[j] -= edge[j]
        for j in range(columns - 1):
            target[j + 1] += edge[j]
        if i == rows - 1:
            break
        a, b, v, low = slope_y[i], slope_y[i + 1], weight[i + 1], out[i + 1]
        if 0 < i < rows - 2:
            c, d = slope_y[i - 1], slope_y[i + 2]
            for j in range(columns):
                edge[j] = (_13 * (a[j] + b[j]) - c[j] - d[j]) * _PART
        else:
            for j in range(columns):
                edge[j] = _HALF * (a[j] + b[j])
        for j in range(columns):
            edge[j] = edge[j] * pitch * (w[j] if w[j] < v[j] else v[j])
        for j in range(columns):
            target[j] -= edge[j]
        for j in range(columns):
            low[j] += edge[j]


@_whole
def _apply(depth, weight, firm, out):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Write the weighted differences' outflow of a depth map; return their product."""
    rows, columns = depth.shape
    edge = np.empty(columns, np.float32)
    before = np.zeros(columns, np.float32)
    total = np.float64(0.0)
    for i in range(rows):
        d, w, target = depth[i], weight[i], out[i]
        for j in range(columns - 1):
            edge[j] = (d[j + 1] - d[j]) * (w[j] if w[j] < w[j + 1] else w[j + 1])
        for j in range(columns):
            target[j] = before[j]
        for j in range(columns - 1):
            target[j] -= edge[j]
        for j in range(columns - 1):
            target[j + 1] += edge[j]
        if i < rows - 1:
            e, v = depth[i + 1], weight[i + 1]
            for j in range(columns):
                before[j] = (e[j] - d[j]) * (w[j] if w[j] < v[j] else v[j])
            for j in range(columns):
                target[j] -= before[j]
        if i == 0:
            for j in range(columns):
                target[j] += firm[j] * d[j]
        if i == rows - 1:
            for j in range(columns):
                target[j] += firm[columns + j] * d[j]
        target[0] += firm[2 * columns + i] * d[0]
        target[columns - 1] += firm[2 * columns + rows + i] * d[columns - 1]
        part = np.float32(0.0)
        for j in range(columns):
            part += target[j] * d[j]
        total += part
    return total
