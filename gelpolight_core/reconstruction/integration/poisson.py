"""From slopes to depth: direct solution of the Poisson equation on the grid.

The unknowns are the depths at the pixel centres, and the depth is 0 on a border that lies half a
pixel outside the outermost pixel centres: the outline of the grid's pixels. This corresponds to the
DST-II. A DST-I requires depth 0 at pixel centres, so that either the outermost pixels are lost or
slopes of an additional ring must be invented.

The right-hand side is built from *edge integrals*, the integral of the slope from one pixel centre
to the next, which is equal to the difference of two depths. The matrix is therefore the plain
five-point one, and the result has the order 4 of the integral.

A sine transform along the rows separates the waves. For each wave, the tridiagonal system along the
columns is solved directly. This is as exact as a transform along both axes, and less work.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import scipy.fft
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array
from gelpolight_core.base.row_threads import RowThreadPool

from .tridiagonal import settled_rows, solve_columns

SLOPE_LIMIT = 10.0
"""Largest slope that is used, 84 degrees. From above, a steeper wall is visible over less than a
tenth of its height and cannot be distinguished from a fault of the image."""

_TAPS = 5


class EdgeWeights(NamedTuple):
    """The divergence of a grid, as sums over five neighbouring nodes.

    Attributes
    ----------
    start_x, start_y : (columns,), (rows,) int
        First of the nodes.
    weight_x, weight_y : (columns, 5), (rows, 5)
        Weights of their slopes along x and y.
    """

    start_x: NDArray[np.int64]
    weight_x: Float32Array
    start_y: NDArray[np.int64]
    weight_y: Float32Array


class PoissonSolver:
    """Integrates slopes on a grid of one size, for which constant data are prepared once.

    Solves, in the least-squares sense over all pixel edges, ``d[j + 1] - d[j] = e[j]`` with ``e``
    the integral of the slope along the edge (the discrete form of the paper's Poisson equation
    with depth 0 on the border). An edge is ``h (-p[j-1] + 13 p[j] + 13 p[j+1] - p[j+2]) / 24``;
    next to the border it is one-sided, of the same order.

    An object can be used by several threads at once: it has no working memory.

    Parameters
    ----------
    rows, columns : int
        Size of the grid, each at least 1.
    pitch_mm : float
        Distance between pixel centres.
    workers : int, optional
        Threads; the result does not depend on their number.

    Raises
    ------
    ValueError
        If an argument is out of range.
    """

    def __init__(self, rows: int, columns: int, *, pitch_mm: float, workers: int = 2) -> None:
        if rows < 1 or columns < 1:
            raise ValueError(f"a grid of {rows} rows and {columns} columns cannot be integrated")
        if not (np.isfinite(pitch_mm) and pitch_mm > 0.0):
            raise ValueError(f"pitch_mm = {pitch_mm}, expected a length above 0")
        self.shape = (rows, columns)
        self.pitch_mm = pitch_mm
        self.workers = workers
        self._workers = RowThreadPool(workers)
        self._waves = _waves(columns)
        self._settled = settled_rows(self._waves, rows)
        self.edges = EdgeWeights(*_axis_stencil(columns), *_axis_stencil(rows))

    def depth_of(self, divergence: Float32Array) -> Float32Array:
        """Return the depth (rows, columns), mm: waves along the rows, elimination down the columns.

        It is 0 half a pixel outside the outermost pixel centres.

        Parameters
        ----------
        divergence : (rows, columns)
            Made with `edges`; overwritten.
        """
        field = self._transform(scipy.fft.dst, divergence)
        blocks = len(self._settled)
        self._workers.run(blocks, solve_columns, field, self._waves, self._settled, -self.pitch_mm)
        return np.ascontiguousarray(self._transform(scipy.fft.idst, field))

    def _transform(self, transform: Callable[..., Any], field: Float32Array) -> Float32Array:
        options = {"type": 2, "axis": 1, "overwrite_x": True, "workers": self.workers}
        return np.asarray(transform(field, **options))


def _waves(length: int) -> NDArray[np.float64]:
    """Eigenvalues of ``-d[j-1] + 2 d[j] - d[j+1]`` for the DST-II, whose index runs from 1 to N.

    The eigenvectors are sin(pi k (j + 1/2) / N): odd about half a pixel outside the border. In
    double precision for any transform: they range from 1e-8 to 4.
    """
    k = np.arange(1, length + 1)
    return 4.0 * np.sin(np.pi * k / (2 * length)) ** 2


def _integral_weights(nodes: NDArray[np.int64], begin: float, end: float) -> NDArray[np.float64]:
    """Weights of the values at `nodes` that integrate their polynomial from `begin` to `end`."""
    shifted = nodes - nodes[0]
    powers = np.arange(len(nodes))
    upper, lower = end - nodes[0], begin - nodes[0]
    moments = (upper ** (powers + 1) - lower ** (powers + 1)) / (powers + 1)
    vandermonde = np.power.outer(shifted.astype(np.float64), powers).T
    return np.linalg.solve(vandermonde, moments)


def _edge_weights(edge: int, length: int) -> NDArray[np.float64]:
    """Weights over the whole line of the integral along one edge, in pixels.

    Edge j runs from pixel centre j - 1 to j; edges 0 and `length` are the half edges between the
    border and the outermost pixel centre.
    """
    first = min(max(edge - 2, 0), max(length - 4, 0))
    nodes = np.arange(first, min(first + 4, length))
    begin, end = max(edge - 1.0, -0.5), min(float(edge), length - 0.5)
    weights = np.zeros(length)
    weights[nodes] = _integral_weights(nodes, begin, end)
    return weights


def _axis_stencil(length: int) -> tuple[NDArray[np.int64], Float32Array]:
    """Weights of the divergence along one axis, for every line of the grid.

    Returns
    -------
    start : (length,)
        First of the five neighbouring pixels that the weights belong to; never falls.
    weights : (length, 5)
        Edge integral after the pixel less the one before it, in pixels.
    """
    start = np.clip(np.arange(length) - 2, 0, max(length - _TAPS, 0))
    weights = np.zeros((length, _TAPS))
    inner = range(2, length - 2)
    for line in {0, *range(length)[1:2], *inner[:1], *range(length)[-2:]}:
        first = start[line]
        line_weights = _line_weights(line, length)[first : first + _TAPS]
        weights[line, : len(line_weights)] = line_weights
    for line in inner[1:]:
        weights[line] = weights[inner[0]]
    return start, weights.astype(np.float32)


def _line_weights(line: int, length: int) -> NDArray[np.float64]:
    """Weights, over the whole axis, of the divergence at one line.

    The transform mirrors the depth with its sign turned about the border, so that its border edge
    is twice the half edge.
    """
    after = (2.0 if line == length - 1 else 1.0) * _edge_weights(line + 1, length)
    before = (2.0 if line == 0 else 1.0) * _edge_weights(line, length)
    return np.asarray(after - before)
