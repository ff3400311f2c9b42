"""From slopes to depth: direct solution of the Poisson equation on the grid.

The unknowns are the depths at the pixel centres, and the depth is 0 on a border that lies half a
pixel outside the outermost pixel centres: the outline of the grid's pixels. This corresponds to the
DST-II. A DST-I requires depth 0 at pixel centres, so that either the outermost pixels are lost or
slopes of an additional ring must be invented.

The right-hand side is built from *edge integrals*, the integral of the slope from one pixel centre
to the next, which is equal to the difference of two depths. The matrix is therefore the plain
five-point one for every stencil, and the order of the result is that of the integral.

A sine transform along the rows separates the waves. For each wave, the tridiagonal system along the
columns is solved directly. This is as exact as a transform along both axes, and less work.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import scipy.fft
from numpy.typing import DTypeLike, NDArray

from gelpolight_core.base.arrays import AnyFloatArray
from gelpolight_core.base.row_threads import RowThreadPool

from .divergence_stencil import divergence_rows
from .tridiagonal import settled_rows, solve_columns

Stencil = Literal[4, 2, 1]

SLOPE_LIMIT = 10.0
"""Largest slope that is used, 84 degrees. From above, a steeper wall is visible over less than a
tenth of its height and cannot be distinguished from a fault of the image."""

_TAPS = 5


@dataclass(frozen=True, slots=True)
class IntegrationResult:
    """Depth from slopes.

    Attributes
    ----------
    depth_mm : (rows, columns)
        Depth at the pixel centres, 0 half a pixel outside the outermost ones.
    sanitised_count : int
        Number of slope values (two per pixel) that were not finite and were set to 0.
    clipped_count : int
        Number of slope values that were clipped to the limit.
    """

    depth_mm: AnyFloatArray
    sanitised_count: int
    clipped_count: int


@dataclass(frozen=True, slots=True)
class EdgeWeights:
    """The divergence of a grid with its padding, as sums over five neighbouring nodes.

    Attributes
    ----------
    start_x, start_y : (padded columns,), (padded rows,) int
        First of the nodes.
    weight_x, weight_y : (padded columns, 5), (padded rows, 5)
        Weights of their slopes along x and y.
    top, left : int
        Lines and columns of padding before the grid.
    """

    start_x: NDArray[np.int64]
    weight_x: AnyFloatArray
    start_y: NDArray[np.int64]
    weight_y: AnyFloatArray
    top: int
    left: int


class PoissonSolver:
    """Integrates slopes on a grid of one size, for which constant data are prepared once.

    Solves, in the least-squares sense over all pixel edges, ``d[j + 1] - d[j] = e[j]`` with ``e``
    the integral of the slope along the edge (the discrete form of the paper's Poisson equation
    with depth 0 on the border). Edge integrals: ``h (-p[j-1] + 13 p[j] + 13 p[j+1] - p[j+2]) / 24``
    for stencil 4, one-sided integrals of the same order next to the border.

    A length with a prime factor above 5, for which the transform is slow, is padded on both sides
    with flat membrane. This moves the border outwards by the padding and has no effect on a contact
    inside the grid. A grid of one row or one column is integrated along the other axis.

    An object can be used by several threads at once: it has no working memory.

    Parameters
    ----------
    rows, columns : int
        Size of the grid, each at least 1.
    pitch_mm : float
        Distance between pixel centres.
    dtype : dtype, optional
        float32 (live path) or float64.
    workers : int, optional
        Threads; the result does not depend on their number.
    stencil : {4, 2, 1}, optional
        Number of slopes in an edge integral: order 4, 2 (trapezoid) or 1 (forward difference,
        for convergence tests only: it shifts the depth by up to half a pixel).
    slope_limit : float, optional
        Slopes are clipped at plus and minus this.

    Raises
    ------
    ValueError
        If an argument is out of range.

    Examples
    --------
    >>> import numpy as np
    >>> x_mm = np.arange(-100, 101) * 0.05
    >>> bump_mm = np.exp(-x_mm**2)[None, :]
    >>> solver = PoissonSolver(1, 201, pitch_mm=0.05, dtype=np.float64)
    >>> result = solver.integrate(-2 * x_mm * bump_mm, np.zeros((1, 201)))
    >>> bool(np.allclose(result.depth_mm, bump_mm, atol=1e-5))
    True
    """

    def __init__(
        self,
        rows: int,
        columns: int,
        *,
        pitch_mm: float,
        dtype: DTypeLike = np.float32,
        workers: int = 2,
        stencil: Stencil = 4,
        slope_limit: float = SLOPE_LIMIT,
    ) -> None:
        self.dtype = np.dtype(dtype)
        _check(rows, columns, pitch_mm, self.dtype, stencil, slope_limit)
        self.shape = (rows, columns)
        self.pitch_mm = pitch_mm
        self.workers = workers
        self.slope_limit = slope_limit
        self._axes = tuple(axis for axis in (0, 1) if self.shape[axis] > 1) or (1,)
        lengths = [good_length(n) for n in self.shape]
        top, start = ((m - n) // 2 for m, n in zip(lengths, self.shape, strict=True))
        self._workers = RowThreadPool(workers)
        waves = _waves(lengths[1]) if 1 in self._axes else np.zeros(lengths[1])
        self._waves = waves
        self._settled = settled_rows(waves, lengths[0], self.dtype)
        (start_y, weight_y), (start_x, weight_x) = (
            _axis_stencil(n, m, stencil if axis in self._axes else 0, self.dtype)
            for axis, (n, m) in enumerate(zip(self.shape, lengths, strict=True))
        )
        self.edges = EdgeWeights(start_x, weight_x, start_y, weight_y, top, start)

    def integrate(self, slope_x: AnyFloatArray, slope_y: AnyFloatArray) -> IntegrationResult:
        """Return the depth whose slopes these are.

        Parameters
        ----------
        slope_x, slope_y : (rows, columns)
            d(depth)/dx along a row and d(depth)/dy along a column, mm per mm. They are not changed,
            and not copied if they are C-contiguous and of the solver's dtype.

        Raises
        ------
        ValueError
            If a shape is not that of the solver.
        """
        for slope in (slope_x, slope_y):
            if np.shape(slope) != self.shape:
                raise ValueError(f"slopes of shape {np.shape(slope)}, solver for {self.shape}")
        edges = self.edges
        field = np.empty((len(edges.weight_y), len(edges.weight_x)), self.dtype)
        faults = np.empty((len(field), 2), np.int64)
        self._workers.run(
            len(field),
            divergence_rows,
            np.ascontiguousarray(slope_x, dtype=self.dtype),
            np.ascontiguousarray(slope_y, dtype=self.dtype),
            edges.start_x,
            edges.weight_x,
            edges.start_y,
            edges.weight_y,
            edges.top,
            edges.left,
            np.asarray(self.slope_limit, dtype=self.dtype)[()],
            field,
            faults,
        )
        bad, clipped = faults.sum(axis=0)
        return IntegrationResult(self.depth_of(field), int(bad), int(clipped))

    def depth_of(self, divergence: AnyFloatArray) -> AnyFloatArray:
        """Return the depth (rows, columns), mm: waves along the rows, elimination down the columns.

        Parameters
        ----------
        divergence : (padded rows, padded columns)
            Made with `edges`; overwritten.
        """
        field, (rows, columns) = divergence, self.shape
        if 1 in self._axes:
            field = self._transform(scipy.fft.dst, field)
        if 0 in self._axes:
            blocks = len(self._settled)
            scale = -self.pitch_mm
            self._workers.run(blocks, solve_columns, field, self._waves, self._settled, scale)
        else:
            field *= (-self.pitch_mm / self._waves).astype(self.dtype)
        if 1 in self._axes:
            field = self._transform(scipy.fft.idst, field)
        top, start = self.edges.top, self.edges.left
        return np.ascontiguousarray(field[top:, start:][:rows, :columns])

    def _transform(self, transform: Callable[..., Any], field: AnyFloatArray) -> AnyFloatArray:
        options = {"type": 2, "axis": 1, "overwrite_x": True, "workers": self.workers}
        return np.asarray(transform(field, **options))


def good_length(length: int) -> int:
    """Return the smallest length, not below `length`, without a prime factor above 5."""
    return int(scipy.fft.next_fast_len(length, real=True))


def _check(
    rows: int, columns: int, pitch_mm: float, dtype: np.dtype[Any], stencil: int, limit: float
) -> None:
    if rows < 1 or columns < 1:
        raise ValueError(f"a grid of {rows} rows and {columns} columns cannot be integrated")
    if not (np.isfinite(pitch_mm) and pitch_mm > 0.0):
        raise ValueError(f"pitch_mm = {pitch_mm}, expected a length above 0")
    if dtype not in (np.dtype(np.float32), np.dtype(np.float64)):
        raise ValueError(f"dtype = {dtype}, expected float32 or float64")
    if stencil not in (4, 2, 1):
        raise ValueError(f"stencil = {stencil}, expected 4, 2 or 1")
    if not (np.isfinite(limit) and limit > 0.0):
        raise ValueError(f"slope_limit = {limit}, expected a slope above 0")


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


def _edge_weights(edge: int, length: int, taps: int) -> NDArray[np.float64]:
    """Weights over the whole line of the integral along one edge, in pixels.

    Edge j runs from pixel centre j - 1 to j; edges 0 and `length` are the half edges between the
    border and the outermost pixel centre.
    """
    first = min(max(edge - (taps + 1) // 2, 0), max(length - taps, 0))
    nodes = np.arange(first, min(first + taps, length))
    begin, end = max(edge - 1.0, -0.5), min(float(edge), length - 0.5)
    weights = np.zeros(length)
    weights[nodes] = _integral_weights(nodes, begin, end)
    return weights


def _axis_stencil(
    length: int, padded: int, taps: int, dtype: np.dtype[Any]
) -> tuple[NDArray[np.int64], AnyFloatArray]:
    """Weights of the divergence along one axis, for every line of the padded grid.

    Returns
    -------
    start : (padded,)
        First of the five neighbouring pixels that the weights belong to; never falls.
    weights : (padded, 5)
        Edge integral after the pixel less the one before it, in pixels; 0 in the padding,
        except for the pixel beside the grid.
    """
    before = (padded - length) // 2
    start = np.clip(np.arange(padded) - before - 2, 0, max(length - _TAPS, 0))
    weights = np.zeros((padded, _TAPS))
    if taps == 0:
        return start, weights.astype(dtype)
    inner = range(2, length - 2)
    for line in {-1, 0, 1, *inner[:1], length - 2, length - 1, length}:
        if 0 <= line + before < padded:
            first = start[line + before]
            line_weights = _line_weights(line, length, padded, taps)[first : first + _TAPS]
            weights[line + before, : len(line_weights)] = line_weights
    for line in inner[1:]:
        weights[line + before] = weights[inner[0] + before]
    return start, weights.astype(dtype)


def _line_weights(line: int, length: int, padded: int, taps: int) -> NDArray[np.float64]:
    """Weights, over the whole unpadded axis, of the divergence at one line (-1 to `length`).

    Without padding the transform mirrors the depth with its sign turned about the border, so that
    its border edge is twice the half edge; with padding the border edge is the half edge alone.
    """
    before = (padded - length) // 2
    weights = np.zeros(length)
    if line < length:
        doubled = line == length - 1 and before + length == padded
        weights += (2.0 if doubled else 1.0) * _edge_weights(line + 1, length, taps)
    if line >= 0:
        doubled = line == 0 and before == 0
        weights -= (2.0 if doubled else 1.0) * _edge_weights(line, length, taps)
    return weights
