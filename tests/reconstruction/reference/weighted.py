"""Plain NumPy oracle of the weighted integration.

Minimises the weighted sum of squared edge errors with depth 0 at the border, by conjugate gradients
with the plain sine-transform solution as preconditioner; with even weights the first step is exact.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy.fft
from numpy.typing import NDArray

Map = NDArray[np.float32]
TOLERANCE = 3e-4
MAX_ROUNDS = 60


@dataclass(frozen=True, slots=True)
class WeightedIntegration:
    """Depth from weighted slopes.

    Attributes
    ----------
    depth_mm : (rows, columns) float32
        At the nodes.
    rounds : int
        Of the conjugate gradients.
    converged : bool
        Whether the tolerance was reached.
    """

    depth_mm: Map
    rounds: int
    converged: bool


def integrate_weighted(
    slope_x: Map,
    slope_y: Map,
    weight: Map,
    *,
    pitch_mm: float,
    start_mm: Map | None = None,
    hold: Map | None = None,
    tolerance: float = TOLERANCE,
    workers: int = 2,
) -> WeightedIntegration:
    """Integrate slopes (rows, columns), each trusted as far as its weight says.

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
        How firmly depth 0 is held just outside the border, 0..1; by default 1 everywhere. Where a
        contact crosses the border, it is let go and what is around leads the depth.
    tolerance : float, optional
        Of the preconditioned residual, relative to the right side's.
    workers : int, optional
        Threads of the transforms.
    """
    firm = np.float32(2.0) * (np.ones_like(weight) if hold is None else hold)
    across = np.minimum(weight[:, 1:], weight[:, :-1])
    down = np.minimum(weight[1:], weight[:-1])
    edges_x = across * _edge_integrals(slope_x) * np.float32(pitch_mm)
    edges_y = down * _edge_integrals(slope_y.T).T * np.float32(pitch_mm)
    waves = [
        (2.0 - 2.0 * np.cos(np.pi * np.arange(1, n + 1) / n)).astype(np.float32)
        for n in weight.shape
    ]
    eigenvalues = waves[0][:, None] + waves[1]

    def precondition(field: Map) -> Map:
        spectrum = scipy.fft.dstn(field, type=2, workers=workers)
        spectrum /= eigenvalues
        return np.asarray(scipy.fft.idstn(spectrum, type=2, workers=workers, overwrite_x=True))

    def apply(depth: Map) -> Map:
        result = _divergence(across * np.diff(depth, axis=1), down * np.diff(depth, axis=0))
        # Depth 0 half a node outside the border: an edge of half the length on each side.
        for side in (np.s_[:, 0], np.s_[:, -1], np.s_[0], np.s_[-1]):
            result[side] += firm[side] * depth[side]
        return result

    right = _divergence(edges_x, edges_y)
    wanted = tolerance**2 * _dot(right, precondition(right))
    depth = np.zeros_like(right) if start_mm is None else start_mm.astype(np.float32)
    left = right - apply(depth)
    better = precondition(left)
    direction = better.copy()
    size = _dot(left, better)
    rounds = 0
    while size > wanted and rounds < MAX_ROUNDS:
        image = apply(direction)
        step = np.float32(size / _dot(direction, image))
        depth += step * direction
        left -= step * image
        better = precondition(left)
        fresh = _dot(left, better)
        direction *= np.float32(fresh / size)
        direction += better
        size = fresh
        rounds += 1
    return WeightedIntegration(depth, rounds, size <= wanted)


def _edge_integrals(slope: NDArray[Any]) -> Map:
    """Return the mean slope along each edge of a row: four nodes, two next to the border."""
    edges = 0.5 * (slope[:, 1:] + slope[:, :-1])
    if slope.shape[1] > 3:
        outer = slope[:, :-3] + slope[:, 3:]
        edges[:, 1:-1] = (13.0 * (slope[:, 1:-2] + slope[:, 2:-1]) - outer) / 24.0
    return np.asarray(edges, np.float32)


def _divergence(edges_x: Map, edges_y: Map) -> Map:
    """Return what flows out of each node, minus what flows in."""
    result = np.zeros((edges_x.shape[0], edges_y.shape[1]), np.float32)
    result[:, 1:] += edges_x
    result[:, :-1] -= edges_x
    result[1:] += edges_y
    result[:-1] -= edges_y
    return result


def _dot(a: Map, b: Map) -> float:
    return float(np.dot(a.ravel().astype(np.float64), b.ravel().astype(np.float64)))
