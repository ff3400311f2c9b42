"""Integration that preserves steps: each node follows the smoother of its two sides.

Bilateral normal integration (Cao, Santo, Shi, Okura, Matsushita, ECCV 2022), for parallel
projection. Each node gives its slope to both neighbours along an axis. A logistic weight prefers
the side that agrees better with the depth. A wall, which no slope shows, therefore separates the
surface at one edge and does not deform the surface beside it. Weights and depth are computed
alternately.

Two things differ from the paper. The paper weights by depth differences; here the residuals are
used, so that a smooth flank keeps both of its sides. Residuals are relative to typical residuals of
the image, so that walls are found at any pitch, and noise alone separates nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.fft
from numpy.typing import NDArray

Array = NDArray[np.float64]
STEEPNESS = 2.0
"""Steepness of the logistic weight: the paper's k, for residuals in units of a typical one."""
UNUSUAL, FLOOR = 3.0, 0.1
"""A residual is typical up to this multiple of the median, and of the pitch."""
MOST_ROUNDS = 150
SETTLED = 1e-5
"""Relative change of the energy below which the rounds end."""
INNER_ROUNDS, INNER_TOLERANCE = 40, 1e-3
LEAST_WEIGHT = 1e-6
"""Least weight of an edge, so that all parts remain connected."""


@dataclass(frozen=True, slots=True)
class BilateralIntegration:
    """Depth with its steps.

    Attributes
    ----------
    depth_mm : (rows, columns) float64
        The median over the valid nodes next to the border is 0; not a number where not valid.
    rounds : int
        Rounds of weights and depth.
    converged : bool
        Whether the energy converged.
    """

    depth_mm: Array
    rounds: int
    converged: bool


def integrate_bilateral(
    slope_x: NDArray[np.floating],
    slope_y: NDArray[np.floating],
    *,
    pitch_mm: float,
    valid: NDArray[np.bool_] | None = None,
    steepness: float = STEEPNESS,
) -> BilateralIntegration:
    """Integrate slopes (rows, columns) of a surface with steps.

    Takes seconds, for frozen images.

    Parameters
    ----------
    slope_x, slope_y : (rows, columns)
        d(depth)/dx and d(depth)/dy; not used where not valid.
    pitch_mm : float
        Distance between nodes.
    valid : (rows, columns) bool, optional
        Nodes with a slope; by default all that are finite.
    steepness : float, optional
        How strongly one side is preferred; 0: not at all, which is plain least squares.

    Raises
    ------
    ValueError
        If the shapes differ, or no node is valid.

    Examples
    --------
    A block 1 mm high with a wall on one side, and a ramp up to its top on the other:

    >>> import numpy as np
    >>> x, y = np.meshgrid(np.arange(60) * 0.1, np.arange(60) * 0.1)
    >>> on_ramp = (y > 2.0) & (y < 4.0)
    >>> depth = np.where(on_ramp, 0.3 * x, 0.0)
    >>> found = integrate_bilateral(np.where(on_ramp, 0.3, 0.0), 0.0 * x, pitch_mm=0.1)
    >>> height = found.depth_mm[30, 55] - found.depth_mm[5, 55]
    >>> bool(abs(height - depth[30, 55]) < 0.05)
    True
    """
    p, q = np.array(slope_x, np.float64), np.array(slope_y, np.float64)
    known = np.isfinite(p) & np.isfinite(q)
    known = known if valid is None else known & valid
    if p.shape != q.shape or not known.any():
        raise ValueError(f"slopes of shapes {p.shape} and {q.shape}, {known.sum()} of them valid")
    p[~known], q[~known] = 0.0, 0.0
    sides = [_Sides(p, q, known, axis) for axis in (1, 0)]
    depth, energy, rounds, converged = np.zeros(p.shape), np.inf, 0, False
    while rounds < MOST_ROUNDS and not converged:
        edges = [side.edges(depth if rounds else None, steepness) for side in sides]
        depth = _solved(edges, depth)
        before, energy = energy, sum(side.energy(depth, steepness) for side in sides)
        rounds += 1
        converged = abs(before - energy) <= SETTLED * max(energy, 1e-300)
    depth *= pitch_mm
    border = known & _ring(known)
    depth -= np.median(depth[border if border.any() else known])
    depth[~known] = np.nan
    return BilateralIntegration(depth, rounds, converged)


class _Sides:
    """The two equations of each node along one axis, in units of the pitch."""

    def __init__(self, p: Array, q: Array, known: NDArray[np.bool_], axis: int) -> None:
        self._axis = axis
        self._slope = p if axis == 1 else q
        # The equation of the normals, n_z dz - n_x = 0, squared: steep slopes are less certain.
        self._trust = 1.0 / (1.0 + p**2 + q**2)
        first, last = _before(axis), _after(axis)
        self._linked = known[first] & known[last]

    def edges(self, depth: Array | None, steepness: float) -> tuple[int, Array, Array]:
        """Return axis, weight of each edge, and weight times the required difference."""
        first, last = _before(self._axis), _after(self._axis)
        ahead = np.full(self._slope.shape, 0.5) if depth is None else self._ahead(depth, steepness)
        near = np.where(self._linked, (ahead * self._trust)[first], 0.0)
        far = np.where(self._linked, ((1.0 - ahead) * self._trust)[last], 0.0)
        flow = near * self._slope[first] + far * self._slope[last]
        return self._axis, near + far + LEAST_WEIGHT, flow

    def energy(self, depth: Array, steepness: float) -> float:
        """Return the weighted sum of squared residuals."""
        ahead = self._ahead(depth, steepness)
        before, after = self._residuals(depth)
        return float(np.sum(self._trust * (ahead * after**2 + (1.0 - ahead) * before**2)))

    def _ahead(self, depth: Array, steepness: float) -> Array:
        """Return the share of each node's weight for the edge after it."""
        before, after = self._residuals(depth)
        preferred = steepness * self._trust * (before**2 - after**2) / self._typical(before, after)
        share = 1.0 / (1.0 + np.exp(-np.clip(preferred, -60.0, 60.0)))
        lonely_before, lonely_after = self._lonely()
        return np.where(lonely_before, 1.0, np.where(lonely_after, 0.0, share))

    def _typical(self, before: Array, after: Array) -> float:
        """Return the square of the largest typical residual."""
        linked = np.abs(after[_before(self._axis)][self._linked])
        usual = float(np.median(linked)) if linked.size else 0.0
        return max(UNUSUAL * usual, FLOOR) ** 2

    def _residuals(self, depth: Array) -> tuple[Array, Array]:
        """Return the residuals of the edge before and the edge after each node."""
        first, last = _before(self._axis), _after(self._axis)
        difference = depth[last] - depth[first]
        before, after = np.zeros(depth.shape), np.zeros(depth.shape)
        before[last] = np.where(self._linked, difference - self._slope[last], 0.0)
        after[first] = np.where(self._linked, difference - self._slope[first], 0.0)
        return before, after

    def _lonely(self) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Return the nodes without an edge before, and without one after."""
        first, last = _before(self._axis), _after(self._axis)
        before = np.ones(self._slope.shape, bool)
        after = before.copy()
        before[last] = ~self._linked
        after[first] = ~self._linked
        return before & ~after, after & ~before


def _solved(edges: list[tuple[int, Array, Array]], start: Array) -> Array:
    """Return the depth that fits the edges best: conjugate gradients from a first guess.

    A cosine transform with equal weights is the preconditioner.
    """
    waves = [4.0 * np.sin(0.5 * np.pi * np.arange(n) / n) ** 2 for n in start.shape]
    eigenvalues = waves[0][:, None] + waves[1]
    eigenvalues[0, 0] = 1.0

    def guess(left: Array) -> Array:
        spectrum = scipy.fft.dctn(left, type=2, norm="ortho", overwrite_x=False) / eigenvalues
        spectrum[0, 0] = 0.0
        return np.asarray(scipy.fft.idctn(spectrum, type=2, norm="ortho"))

    def outflow(field: Array) -> Array:
        out = np.zeros_like(field)
        for axis, weight, _ in edges:
            flow = weight * (field[_after(axis)] - field[_before(axis)])
            out[_after(axis)] += flow
            out[_before(axis)] -= flow
        return out

    wanted = np.zeros_like(start)
    for axis, _, flow in edges:
        wanted[_after(axis)] += flow
        wanted[_before(axis)] -= flow
    depth, left = start.copy(), wanted - outflow(start)
    better = guess(left)
    direction, size = better.copy(), float(np.sum(left * better))
    # Relative to the whole right-hand side, so that a nearly correct start is not changed.
    enough = INNER_TOLERANCE**2 * float(np.sum(wanted * guess(wanted)))
    for _ in range(INNER_ROUNDS):
        if size <= enough:
            break
        image = outflow(direction)
        step = size / float(np.sum(direction * image))
        depth += step * direction
        left -= step * image
        better = guess(left)
        size, before = float(np.sum(left * better)), size
        direction = better + (size / before) * direction
    return depth


def _before(axis: int) -> tuple[slice, slice]:
    return (slice(None), slice(None, -1)) if axis == 1 else (slice(None, -1), slice(None))


def _after(axis: int) -> tuple[slice, slice]:
    return (slice(None), slice(1, None)) if axis == 1 else (slice(1, None), slice(None))


def _ring(known: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return the outermost nodes of the grid, or of its valid part if that is smaller."""
    rows, columns = np.flatnonzero(known.any(axis=1)), np.flatnonzero(known.any(axis=0))
    ring = np.zeros(known.shape, bool)
    ring[[rows[0], rows[-1]], :] = True
    ring[:, [columns[0], columns[-1]]] = True
    return ring
