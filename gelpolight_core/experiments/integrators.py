"""Error against run time of integration alone, where the truth is a formula."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.reconstruction.plain import plain_depth
from gelpolight_core.reconstruction.poisson import PoissonSolver
from gelpolight_core.reconstruction.weighted import integrate_weighted
from gelpolight_core.translation import tr

Array = NDArray[np.float64]
SIDES = (60, 120, 240, 480, 960)
WIDTH_MM = 20.0
BUMP_MM = 2.0
PEAK_MM = 1.0
FLOOR_UM = 5e-5
"""Below it single precision rounds; orders are taken above it."""


@dataclass(frozen=True, slots=True)
class IntegratorPoint:
    """One integrator on one grid.

    Attributes
    ----------
    name, label : str
        For files and people.
    side : int
        Nodes along each side.
    median_ms, p95_ms : float
        After warm-up.
    rms_um : float
        Error of the depth of a smooth bump of 1 mm.
    order : float or None
        How the error fell since the grid of half the nodes; None where rounding or the tolerance
        decides, or there is no such grid.
    """

    name: str
    label: str
    side: int
    median_ms: float
    p95_ms: float
    rms_um: float
    order: float | None


Integrate = Callable[[Array, Array, float], NDArray[np.floating]]


def measure_integrators(
    *, sides: Sequence[int] = SIDES, repeats: int = 15
) -> tuple[IntegratorPoint, ...]:
    """Return error and time of each integrator, from the smallest grid to the largest."""
    makers = _integrators()
    table: dict[str, list[tuple[int, float, float, float]]] = {name: [] for name in makers}
    for side in sides:
        depth, slope_x, slope_y, pitch = gaussian_bump(side)
        errors, times = {}, {name: list[float]() for name in makers}
        for name, (_, integrate) in makers.items():
            found = integrate(slope_x, slope_y, pitch)
            errors[name] = 1e3 * float(np.sqrt(np.mean((found - depth) ** 2)))
        for _ in range(repeats):
            for name, (_, integrate) in makers.items():
                begin = time.perf_counter()
                integrate(slope_x, slope_y, pitch)
                times[name].append(1e3 * (time.perf_counter() - begin))
        for name in makers:
            taken = times[name]
            row = (side, float(np.median(taken)), float(np.percentile(taken, 95)), errors[name])
            table[name].append(row)
    return tuple(
        IntegratorPoint(name, makers[name][0], side, median, p95, error, order)
        for name, rows in table.items()
        for (side, median, p95, error), order in zip(rows, _orders(rows), strict=True)
    )


def _orders(rows: Sequence[tuple[int, float, float, float]]) -> list[float | None]:
    orders: list[float | None] = [None]
    for (coarse, _, _, before), (fine, _, _, after) in pairwise(rows):
        known = after > FLOOR_UM and before > after
        orders.append(float(np.log(before / after) / np.log(fine / coarse)) if known else None)
    return orders


def gaussian_bump(side: int) -> tuple[Array, Array, Array, float]:
    """Return a bump (side, side) that is as good as 0 at the border, its slopes and its pitch."""
    pitch = WIDTH_MM / side
    axis = (np.arange(side) - 0.5 * (side - 1)) * pitch
    x, y = np.meshgrid(axis + 0.3, axis - 0.2)
    depth = PEAK_MM * np.exp(-(x**2 + y**2) / (2.0 * 0.5 * BUMP_MM**2))
    scale = -1.0 / (0.5 * BUMP_MM**2)
    return depth, scale * x * depth, scale * y * depth, pitch


def _integrators() -> dict[str, tuple[str, Integrate]]:
    found: dict[str, tuple[str, Integrate]] = {}
    for stencil in (1, 2, 4):
        label = tr("sine transform, {n} slopes an edge").format(n=stencil)
        found[f"stencil_{stencil}"] = (label, _poisson(stencil, np.float32))
    label = tr("sine transform, 4 slopes an edge, double precision")
    found["stencil_4_double"] = (label, _poisson(4, np.float64))
    found["weighted"] = (tr("weighted conjugate gradients"), _weighted)
    found["plain"] = (tr("plain five-point solve, double precision"), plain_depth)
    return found


def _poisson(stencil: int, kind: type[np.floating]) -> Integrate:
    kept: dict[int, PoissonSolver] = {}

    def integrate(slope_x: Array, slope_y: Array, pitch_mm: float) -> NDArray[np.floating]:
        rows, columns = slope_x.shape
        if rows not in kept:
            kept[rows] = PoissonSolver(
                rows,
                columns,
                pitch_mm=pitch_mm,
                dtype=kind,
                stencil=stencil,  # type: ignore[arg-type]
            )
        return kept[rows].integrate(slope_x, slope_y).depth_mm

    return integrate


def _weighted(slope_x: Array, slope_y: Array, pitch_mm: float) -> NDArray[np.floating]:
    weight = np.ones(slope_x.shape, np.float32)
    return integrate_weighted(
        np.ascontiguousarray(slope_x, np.float32),
        np.ascontiguousarray(slope_y, np.float32),
        weight,
        pitch_mm=pitch_mm,
    ).depth_mm
