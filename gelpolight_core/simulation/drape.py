"""The shape of the membrane over an indenter: an elastic foundation with an obstacle.

Outside the contact the depth w satisfies ``lambda^2 laplacian(w) = w``; in the contact the membrane
follows the indenter; everywhere w is at least the indenter's depth. For an axisymmetric shape the
free part is ``w = w_b K0(r / lambda) / K0(b / lambda)``, and the membrane leaves the shape at the
radius b at which both slopes are equal.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.special import k0, k1

from gelpolight_core.base.arrays import BoolArray, Float64Array

from .simulation_kernel import Interrupt, compiled, never_interrupt

NOWHERE_MM = -1e9
"""Depth of an obstacle outside its outline."""

_SWEEPS_AT_ONCE = 25  # takes a few hundredths of a second on the finest grids


def contact_radius(
    profile: Callable[[float], tuple[float, float]], edge_mm: float, decay_mm: float
) -> float:
    """Return the radius at which the membrane leaves an axisymmetric shape.

    Parameters
    ----------
    profile : callable
        Maps the radius in mm to (depth of the shape, its decrease per mm of radius); the decrease
        must grow with the radius.
    edge_mm : float
        Radius of the shape's edge.
    decay_mm : float
        Decay length lambda of the foundation.

    Returns
    -------
    float
        b in mm; the edge radius if the membrane stays on the shape up to its edge.
    """
    from scipy.optimize import brentq  # slow to import

    def steeper(radius: float) -> float:
        depth, fall = profile(radius)
        ratio = float(k1(radius / decay_mm) / k0(radius / decay_mm))
        return fall - depth * ratio / decay_mm

    first, last = 1e-9 * edge_mm, edge_mm * (1.0 - 1e-12)
    if steeper(last) <= 0.0:
        return edge_mm
    if steeper(first) >= 0.0:
        return 0.0
    return float(brentq(steeper, first, last, xtol=1e-13))


def free_profile(
    radius_mm: Float64Array, contact_mm: float, depth_mm: float, decay_mm: float
) -> Float64Array:
    """Return the depth outside a round contact: ``depth K0(r / lambda) / K0(b / lambda)``."""
    if contact_mm <= 0.0:
        return np.zeros_like(radius_mm)
    return np.asarray(depth_mm * k0(radius_mm / decay_mm) / k0(contact_mm / decay_mm))


@compiled
def _sweep(
    depth: Any, obstacle: Any, weight: float, relaxation: float
) -> float:  # pragma: no cover - compiled
    """Make one projected over-relaxed Gauss-Seidel sweep and return the largest change."""
    largest = 0.0
    centre = 1.0 / (1.0 + 4.0 * weight)
    for i in range(1, depth.shape[0] - 1):
        for j in range(1, depth.shape[1] - 1):
            neighbours = depth[i - 1, j] + depth[i + 1, j] + depth[i, j - 1] + depth[i, j + 1]
            old = depth[i, j]
            new = old + relaxation * (weight * neighbours * centre - old)
            new = max(new, obstacle[i, j])
            depth[i, j] = new
            largest = max(largest, abs(new - old))
    return largest


@compiled
def _relax(
    depth: Any, obstacle: Any, weight: float, relaxation: float, tolerance: float
) -> bool:  # pragma: no cover - compiled
    """Sweep until the change is below the tolerance and return whether this was reached."""
    for _ in range(_SWEEPS_AT_ONCE):
        if _sweep(depth, obstacle, weight, relaxation) < tolerance:
            return True
    return False


def solve_drape(
    obstacle: Callable[[Float64Array, Float64Array], Float64Array],
    x_mm: Float64Array,
    y_mm: Float64Array,
    *,
    decay_mm: float,
    tolerance_mm: float = 2e-7,
    interrupt: Interrupt = never_interrupt,
) -> tuple[Float64Array, BoolArray]:
    """Solve the obstacle problem on a grid with a flat border.

    Projected successive over-relaxation, started from the solution on grids of twice the pitch.

    Parameters
    ----------
    obstacle : callable
        (x_mm, y_mm) -> depth of the indenter; `NOWHERE_MM` outside it.
    x_mm, y_mm : (columns,), (rows,)
        Evenly spaced positions with one common pitch.
    decay_mm : float
        Decay length lambda.
    tolerance_mm : float, optional
        Largest change of the last sweep.
    interrupt : callable, optional
        Called regularly; an exception raised by it stops the work.

    Returns
    -------
    depth_mm : (rows, columns)
    contact : (rows, columns) bool
    """
    pitch = float(x_mm[1] - x_mm[0])
    if min(x_mm.size, y_mm.size) > 48:
        coarse_x = np.arange(x_mm[0], x_mm[-1] + 2.0 * pitch, 2.0 * pitch)
        coarse_y = np.arange(y_mm[0], y_mm[-1] + 2.0 * pitch, 2.0 * pitch)
        coarse, _ = solve_drape(
            obstacle,
            coarse_x,
            coarse_y,
            decay_mm=decay_mm,
            tolerance_mm=4.0 * tolerance_mm,
            interrupt=interrupt,
        )
        depth = _between(coarse, y_mm.size, x_mm.size)
    else:
        depth = np.zeros((y_mm.size, x_mm.size))
    shape = np.ascontiguousarray(obstacle(*np.meshgrid(x_mm, y_mm)), dtype=np.float64)
    depth[0], depth[-1], depth[:, 0], depth[:, -1] = 0.0, 0.0, 0.0, 0.0
    weight = (decay_mm / pitch) ** 2
    radius = 4.0 * weight / (1.0 + 4.0 * weight)
    # Young's optimal factor for the problem without the obstacle, which converges more slowly.
    relaxation = 2.0 / (1.0 + math.sqrt(1.0 - radius * radius))
    for _ in range(0, 4000, _SWEEPS_AT_ONCE):
        interrupt()
        if _relax(depth, shape, weight, relaxation, tolerance_mm):
            break
    return depth, depth <= shape + 1e-9


def _between(coarse: Float64Array, rows: int, columns: int) -> Float64Array:
    """Return a grid of half the pitch, linear between the cells."""
    fine = np.empty((2 * coarse.shape[0] - 1, 2 * coarse.shape[1] - 1))
    fine[::2, ::2] = coarse
    fine[1::2, ::2] = 0.5 * (coarse[1:] + coarse[:-1])
    fine[:, 1::2] = 0.5 * (fine[:, 2::2] + fine[:, :-2:2])
    return np.ascontiguousarray(fine[:rows, :columns])
