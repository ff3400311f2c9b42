"""Error and run time of integrators on surfaces with an exact formula."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.experiments.integrators.others import (
    cosine_transform,
    frankot_chellappa,
    shifted_cosine_transform,
    sparse_quadratic,
)
from gelpolight_core.experiments.integrators.surfaces import SURFACES, Surface, surface
from gelpolight_core.experiments.orders import Order, fit_order
from gelpolight_core.reconstruction.integration.bilateral import integrate_bilateral
from gelpolight_core.reconstruction.integration.poisson import PoissonSolver
from gelpolight_core.reconstruction.integration.weighted import integrate_weighted
from gelpolight_core.translation import tr

Progress = Callable[[str, float], None]
Map = NDArray[np.floating[Any]]
Integrate = Callable[[Surface], Map]
SIDE = 160
SIDES = (40, 60, 120, 240, 480)
MOST_SIDE = 240
"""Largest grid of the integrators that take seconds there."""
ROUNDING_UM = 3e-5
"""Smaller errors are rounding errors of single precision and are not used for an order."""


@dataclass(frozen=True, slots=True)
class Integrator:
    """A method from slopes to depth.

    Attributes
    ----------
    name, label : str
        For files and people.
    make : callable
        Prepares it for a grid of one size: returns a function from surface to depth.
    slow : bool
        Whether large grids take seconds.
    """

    name: str
    label: str
    make: Callable[[int, float], Integrate]
    slow: bool = False


@dataclass(frozen=True, slots=True)
class IntegratorPoint:
    """One integrator on one surface and grid; errors are absolute, without their median.

    Attributes
    ----------
    name, label, scene, scene_label : str
        Integrator and surface.
    side : int
        Nodes along each axis.
    median_ms, p95_ms : float
        After warm-up.
    mean_um, middle_um : float
        Mean and median absolute error.
    """

    name: str
    label: str
    scene: str
    scene_label: str
    side: int
    median_ms: float
    p95_ms: float
    mean_um: float
    middle_um: float


def integrators() -> tuple[Integrator, ...]:
    """Return all integrators, ours first."""
    return (
        Integrator("sine_4", tr("sine transform, 4 slopes an edge (ours, live)"), _sine(4)),
        Integrator("weighted", tr("weighted conjugate gradients (ours, best)"), _weighted),
        Integrator("bilateral", tr("bilateral, keeps steps (ours, frozen)"), _bilateral, slow=True),
        Integrator("sine_2", tr("sine transform, trapezoid"), _sine(2)),
        Integrator("sine_1", tr("sine transform, forward differences"), _sine(1)),
        Integrator("cosine", tr("cosine transform, Neumann"), _plain(cosine_transform)),
        Integrator("fourier", tr("Frankot-Chellappa"), _plain(frankot_chellappa)),
        Integrator("sparse", tr("direct sparse least squares"), _sparse, slow=True),
        Integrator(
            "shifted", tr("cosine transform, wrong eigenvalues"), _plain(shifted_cosine_transform)
        ),
    )


def measure_integrators(
    *,
    sides: Sequence[int] = SIDES,
    side: int = SIDE,
    repeats: int = 7,
    progress: Progress | None = None,
) -> tuple[IntegratorPoint, ...]:
    """Measure every integrator on the smooth bump at several sizes, and on all surfaces at one.

    Parameters
    ----------
    sides : sequence of int, optional
        Nodes along each axis, on the smooth bump.
    side : int, optional
        The same, on all surfaces.
    repeats : int, optional
        Timed runs; one for slow integrators.
    progress : callable, optional
        Called with the present task and the share done.
    """
    work = [("bump", n) for n in sides if n != side] + [(name, side) for name in SURFACES]
    points = []
    for number, (name, nodes) in enumerate(work):
        scene = surface(name, nodes)
        if progress is not None:
            progress(scene.label, number / len(work))
        for integrator in integrators():
            if nodes <= MOST_SIDE or not integrator.slow:
                points.append(_measured(integrator, scene, 1 if integrator.slow else repeats))
    return tuple(points)


def integrator_order(points: Sequence[IntegratorPoint], name: str) -> Order | None:
    """Return the order of an integrator on the smooth bump, without rounding errors."""
    mine = [p for p in points if p.name == name and p.scene == "bump" and p.mean_um > ROUNDING_UM]
    return fit_order([1.0 / p.side for p in mine], [p.mean_um for p in mine])


def _measured(integrator: Integrator, scene: Surface, repeats: int) -> IntegratorPoint:
    integrate = integrator.make(len(scene.depth_mm), scene.pitch_mm)
    found = integrate(scene)
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        integrate(scene)
        times.append(1e3 * (time.perf_counter() - begin))
    error = found - scene.depth_mm
    away = 1e3 * np.abs(error - np.median(error))
    return IntegratorPoint(
        integrator.name,
        integrator.label,
        scene.name,
        scene.label,
        len(scene.depth_mm),
        float(np.median(times)),
        float(np.percentile(times, 95)),
        float(away.mean()),
        float(np.median(away)),
    )


def _sine(stencil: int) -> Callable[[int, float], Integrate]:
    def make(side: int, pitch_mm: float) -> Integrate:
        solver = PoissonSolver(side, side, pitch_mm=pitch_mm, stencil=stencil)  # type: ignore[arg-type]
        return lambda scene: solver.integrate(scene.slope_x, scene.slope_y).depth_mm

    return make


def _plain(solve: Callable[[Map, Map, float], Map]) -> Callable[[int, float], Integrate]:
    def make(_side: int, pitch_mm: float) -> Integrate:
        return lambda scene: solve(scene.slope_x, scene.slope_y, pitch_mm)

    return make


def _weighted(_side: int, pitch_mm: float) -> Integrate:
    def integrate(scene: Surface) -> Map:
        slope_x, slope_y, weight, hold = (
            np.ascontiguousarray(a, np.float32)
            for a in (scene.slope_x, scene.slope_y, scene.weight, scene.hold)
        )
        found = integrate_weighted(slope_x, slope_y, weight, pitch_mm=pitch_mm, hold=hold)
        return found.depth_mm

    return integrate


def _bilateral(_side: int, pitch_mm: float) -> Integrate:
    def integrate(scene: Surface) -> Map:
        known = scene.weight > 0.0
        found = integrate_bilateral(scene.slope_x, scene.slope_y, pitch_mm=pitch_mm, valid=known)
        return np.where(known, found.depth_mm, scene.depth_mm)

    return integrate


def _sparse(_side: int, pitch_mm: float) -> Integrate:
    return lambda scene: sparse_quadratic(scene.slope_x, scene.slope_y, pitch_mm, scene.weight)
