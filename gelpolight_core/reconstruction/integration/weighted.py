"""Integration with weights: unreliable slopes have little effect on the depth.

Minimises the weighted sum of squared edge errors with depth 0 at the border, by conjugate gradients
with the plain sine-transform solution as preconditioner; with even weights the first step is exact.
Every pass goes row by row, and sums are added row by row, so that the result does not depend on the
number of threads.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.fft

from gelpolight_core.base import compiling
from gelpolight_core.base.arrays import Float32Array
from gelpolight_core.base.row_threads import RowThreadPool
from gelpolight_core.reconstruction.compiled import HALF, ONE, ZERO, single

from .tridiagonal import settled_rows, solve_columns

TOLERANCE = 3e-4
FREE = 1e-4
"""Weight of depth 0 at the border where a contact crosses it."""
SHARED_NODES, SHARED_SUMS = 60_000, 200_000
"""For smaller grids, one thread finishes transforms and passes before a second thread starts."""

_flags = {"nsz", "arcp", "contract", "reassoc"}
_whole, _part = compiling.whole(fastmath=_flags), compiling.part(fastmath=_flags)
_SHARE = single(1.0 / 24.0)


@dataclass(frozen=True, slots=True)
class WeightedIntegrationResult:
    """Depth from weighted slopes.

    Attributes
    ----------
    depth_mm : (rows, columns) float32
        Depth at the nodes.
    rounds : int
        Rounds of the conjugate gradients.
    converged : bool
        Whether the tolerance was reached.
    """

    depth_mm: Float32Array
    rounds: int
    converged: bool


def integrate_weighted(
    slope_x: Float32Array,
    slope_y: Float32Array,
    weight: Float32Array,
    *,
    pitch_mm: float,
    start_mm: Float32Array | None = None,
    hold: Float32Array | None = None,
    tolerance: float = TOLERANCE,
    workers: RowThreadPool | None = None,
) -> WeightedIntegrationResult:
    """Integrate slopes (rows, columns) float32 with weights.

    Parameters
    ----------
    slope_x, slope_y : (rows, columns)
        d(depth)/dx and d(depth)/dy.
    weight : (rows, columns)
        0..1; an edge has the smaller weight of its two nodes.
    pitch_mm : float
        Distance between nodes.
    start_mm : (rows, columns), optional
        A first guess.
    hold : (rows, columns), optional
        Weight of depth 0 just outside the border, 0..1; by default 1 everywhere. Where a contact
        crosses the border it is small, and the depth follows from the surroundings.
    tolerance : float, optional
        Residual relative to the depth, as root mean square weighted slope.
    workers : RowThreadPool, optional
        Threads; by default one.
    """
    solve = _WeightedSystem(slope_x, slope_y, weight, pitch_mm, hold, workers)
    depth = np.zeros(weight.shape, np.float32) if start_mm is None else np.array(start_mm, "f4")
    residual, energy = solve.residual, 0.0
    if start_mm is not None:
        energy = solve.apply(depth)
        residual -= solve.image
    preconditioned = solve.precondition(residual)
    direction = preconditioned.copy()
    size = solve.product(residual, preconditioned)
    target_size = tolerance**2 * max(energy, size)
    rounds = 0
    while size > target_size and rounds < 60:
        curvature = solve.apply(direction)
        solve.run(_advance, single(size / curvature), direction, solve.image, depth, residual)
        rounds += 1
        preconditioned = solve.precondition(residual)
        new_size = solve.product(residual, preconditioned)
        solve.run(_turn, single(new_size / size), preconditioned, direction)
        size = new_size
    return WeightedIntegrationResult(depth, rounds, size <= target_size)


class _WeightedSystem:
    """The weighted equations of one grid."""

    def __init__(
        self,
        slope_x: Float32Array,
        slope_y: Float32Array,
        weight: Float32Array,
        pitch_mm: float,
        hold: Float32Array | None,
        workers: RowThreadPool | None,
    ) -> None:
        rows, columns = weight.shape
        self._weight = weight
        self._shared = workers if weight.size > SHARED_NODES else None
        self._workers = workers if weight.size > SHARED_SUMS else None
        self._threads = 1 if self._shared is None else self._shared.count
        self._firm = np.full(2 * (rows + columns), 2.0, np.float32)
        if hold is not None:
            edges = (hold[0], hold[-1], hold[:, 0], hold[:, -1])
            self._firm = np.concatenate(edges).astype(np.float32) * np.float32(2.0)
        self._waves = 2.0 - 2.0 * np.cos(np.pi * np.arange(1, columns + 1) / columns)
        self._settled = settled_rows(self._waves, rows)
        self._sums = np.empty(rows, np.float64)
        self.image = np.empty(weight.shape, np.float32)
        self.residual = np.empty(weight.shape, np.float32)
        self.run(_flow, slope_x, slope_y, weight, single(pitch_mm), self.residual)

    def run(self, action: Callable[..., object], *arguments: Any) -> None:
        """Run a compiled function over all rows."""
        _run(self._workers, len(self._weight), action, *arguments)

    def apply(self, depth: Float32Array) -> float:
        """Write the weighted divergence of a depth map to `image`, and return their product."""
        self.run(_apply, depth, self._weight, self._firm, self.image, self._sums)
        return float(self._sums.sum())

    def product(self, a: Float32Array, b: Float32Array) -> float:
        self.run(_products, a, b, self._sums)
        return float(self._sums.sum())

    def precondition(self, field: Float32Array) -> Float32Array:
        """Return the solution with even weights."""
        spectrum = scipy.fft.dst(field, type=2, axis=1, workers=self._threads)
        blocks = self._settled.size
        _run(self._shared, blocks, solve_columns, spectrum, self._waves, self._settled, 1.0)
        return np.asarray(
            scipy.fft.idst(spectrum, type=2, axis=1, workers=self._threads, overwrite_x=True)
        )


def _run(
    workers: RowThreadPool | None, count: int, action: Callable[..., object], *arguments: Any
) -> None:
    if workers is None:
        action(0, count, *arguments)
    else:
        workers.run(count, action, *arguments)


@_whole
def _products(first, last, a, b, sums):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    for i in range(first, last):
        p, q = a[i], b[i]
        part = ZERO
        for j in range(p.shape[0]):
            part += p[j] * q[j]
        sums[i] = part


@_whole
def _advance(first, last, step, direction, image, depth, residual):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    for i in range(first, last):
        p, q, d, e = direction[i], image[i], depth[i], residual[i]
        for j in range(p.shape[0]):
            d[j] += step * p[j]
        for j in range(p.shape[0]):
            e[j] -= step * q[j]


@_whole
def _turn(first, last, share, better, direction):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    for i in range(first, last):
        p, q = direction[i], better[i]
        for j in range(p.shape[0]):
            p[j] = share * p[j] + q[j]


@_part
def _least(a, b):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    return a if a < b else b


@_part
def _integral(a, b, before, after, weight_before, weight_after):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Return the mean slope of an edge from four nodes: its own two, and the next on each side.

    Nodes without weight are left out.
    """
    first = ONE if weight_before > ZERO else ZERO
    second = ONE if weight_after > ZERO else ZERO
    bend = first * (a + a - b - before) + second * (b + b - a - after)
    return HALF * (a + b) + bend * (_SHARE if first * second > ZERO else _SHARE + _SHARE)


@_part
def _down(i, slope, weight, edge):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Write the weighted mean slope along the edges from row i to row i + 1."""
    a, b, w, v = slope[i], slope[i + 1], weight[i], weight[i + 1]
    columns = edge.shape[0]
    if 0 < i < slope.shape[0] - 2:
        c, d, x, y = slope[i - 1], slope[i + 2], weight[i - 1], weight[i + 2]
        for j in range(columns):
            smaller = _least(w[j], v[j])
            edge[j] = smaller * _integral(a[j], b[j], c[j], d[j], x[j], y[j])
    else:
        for j in range(columns):
            edge[j] = HALF * (a[j] + b[j]) * _least(w[j], v[j])


@_whole
def _flow(first, last, slope_x, slope_y, weight, pitch, out):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Write the weighted divergence of the slopes at each node."""
    rows, columns = weight.shape
    edge, up = np.zeros(columns, np.float32), np.zeros(columns, np.float32)
    low = np.zeros(columns, np.float32)
    for i in range(first, last):
        s, w, target = slope_x[i], weight[i], out[i]
        for j in range(columns - 1):
            edge[j] = HALF * (s[j] + s[j + 1]) * _least(w[j], w[j + 1])
        for j in range(1, columns - 2):
            smaller = _least(w[j], w[j + 1])
            edge[j] = smaller * _integral(s[j], s[j + 1], s[j - 1], s[j + 2], w[j - 1], w[j + 2])
        if i == first and i > 0:
            _down(i - 1, slope_y, weight, up)
        if i < rows - 1:
            _down(i, slope_y, weight, low)
        else:
            low[:] = ZERO
        for j in range(columns):
            target[j] = (up[j] - low[j]) * pitch
        for j in range(columns - 1):
            target[j] -= edge[j] * pitch
        for j in range(columns - 1):
            target[j + 1] += edge[j] * pitch
        up, low = low, up


@_whole
def _apply(first, last, depth, weight, firm, out, sums):  # type: ignore[no-untyped-def]  # pragma: no cover - compiled
    """Write the divergence of the weighted differences of a depth map, and each row's product."""
    rows, columns = depth.shape
    edge = np.empty(columns, np.float32)
    for i in range(first, last):
        d, w, target = depth[i], weight[i], out[i]
        for j in range(columns - 1):
            edge[j] = (d[j + 1] - d[j]) * _least(w[j], w[j + 1])
        if i > 0:
            e, v = depth[i - 1], weight[i - 1]
            for j in range(columns):
                target[j] = (d[j] - e[j]) * _least(w[j], v[j])
        else:
            for j in range(columns):
                target[j] = firm[j] * d[j]
        if i < rows - 1:
            e, v = depth[i + 1], weight[i + 1]
            for j in range(columns):
                target[j] -= (e[j] - d[j]) * _least(w[j], v[j])
        else:
            for j in range(columns):
                target[j] += firm[columns + j] * d[j]
        for j in range(columns - 1):
            target[j] -= edge[j]
        for j in range(columns - 1):
            target[j + 1] += edge[j]
        target[0] += firm[2 * columns + i] * d[0]
        target[columns - 1] += firm[2 * columns + rows + i] * d[columns - 1]
        part = ZERO
        for j in range(columns):
            part += target[j] * d[j]
        sums[i] = part
