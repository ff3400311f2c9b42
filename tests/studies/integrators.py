"""Error and run time of integrators on surfaces with an exact formula.

    python -m tests.studies.integrators

Ours and others, from their published equations, in double precision. Each takes d(depth)/dx and
d(depth)/dy and returns the depth; the constant of the others is free. Errors are absolute, without
their median. The order of convergence is that on the smooth bump.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
import scipy.fft
from scipy.sparse import csc_matrix, diags_array
from scipy.sparse.linalg import spsolve

from gelpolight_core.reconstruction.integration.poisson import PoissonSolver
from gelpolight_core.reconstruction.integration.weighted import integrate_weighted
from tests.studies.presses import show

WIDTH_MM = 10.0
NOISE = 0.02
HOLES_MM = ((0.8, 0.6, 0.5), (-1.2, 0.4, 0.6), (0.2, -1.3, 0.4), (-0.9, -1.1, 0.5))
SIDE, SIDES, REPEATS = 160, (40, 80, 160), 5
ROUNDING_UM = 3e-5
"""Smaller errors are rounding errors of single precision and are not used for an order."""


class Scene(NamedTuple):
    """Exact depth and slopes (side, side); weight 0 where the slope is unknown, hold 0 at a cut."""

    depth_mm: np.ndarray
    slope_x: np.ndarray
    slope_y: np.ndarray
    weight: np.ndarray
    hold: np.ndarray
    pitch_mm: float


def _bump(x: np.ndarray, y: np.ndarray, x_mm: float = 0.0) -> tuple[np.ndarray, ...]:
    depth = np.exp(-((x - x_mm) ** 2 + y**2) / 1.4)
    return depth, -2.0 / 1.4 * (x - x_mm) * depth, -2.0 / 1.4 * y * depth


def _walls(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return a round plateau of 1 mm with walls of up to 76 degrees."""
    width, radius = 0.125, np.maximum(np.hypot(x, y), 1e-9)
    rise = np.tanh((2.0 - radius) / width)
    fall = -0.5 * (1.0 - rise**2) / width
    return 0.5 * (1.0 + rise), fall * x / radius, fall * y / radius


def _free_form(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, ...]:
    """Return waves that fade towards the border."""
    fade = np.exp(-(x**2 + y**2) / 3.0)
    wave = 0.6 + 0.3 * np.sin(2.1 * x + 0.4) * np.cos(1.7 * y) + 0.1 * np.sin(3.0 * y - x)
    along_x = 0.63 * np.cos(2.1 * x + 0.4) * np.cos(1.7 * y) - 0.1 * np.cos(3.0 * y - x)
    along_y = -0.51 * np.sin(2.1 * x + 0.4) * np.sin(1.7 * y) + 0.3 * np.cos(3.0 * y - x)
    slope_x = fade * (along_x - 2.0 / 3.0 * x * wave)
    return fade * wave, slope_x, fade * (along_y - 2.0 / 3.0 * y * wave)


SCENES = {
    "bump": _bump,
    "free form": _free_form,
    "walls": _walls,
    "cut": lambda x, y: _bump(x, y, 4.6),
    "holes": _bump,
    "noise": _bump,
}


def scene(name: str, side: int) -> Scene:
    """Return one of `SCENES` with `side` nodes along each axis."""
    pitch = WIDTH_MM / side
    axis = (np.arange(side) - 0.5 * (side - 1)) * pitch
    x, y = np.meshgrid(axis + 0.03, axis - 0.02)
    depth, slope_x, slope_y = SCENES[name](x, y)
    weight, hold = np.ones_like(x), np.ones_like(x)
    if name == "cut":
        hold = np.where(depth > 1e-3, 0.0, 1.0)
    if name == "holes":
        for hole_x, hole_y, radius in HOLES_MM:
            weight[np.hypot(x - hole_x, y - hole_y) < radius] = 0.0
    if name == "noise":
        noise = NOISE * np.random.default_rng(0).standard_normal((2, side, side))
        slope_x, slope_y = slope_x + noise[0], slope_y + noise[1]
    return Scene(depth, slope_x * weight, slope_y * weight, weight, hold, pitch)


def cosine_transform(slope_x: np.ndarray, slope_y: np.ndarray, pitch_mm: float) -> np.ndarray:
    """Solve the Poisson equation with Neumann boundary by a DCT (Simchony et al. 1990)."""
    # The edges' mean slopes; no edge crosses the border.
    along_x = np.pad(0.5 * (slope_x[:, 1:] + slope_x[:, :-1]), ((0, 0), (1, 1)))
    along_y = np.pad(0.5 * (slope_y[1:] + slope_y[:-1]), ((1, 1), (0, 0)))
    divergence = np.diff(along_x, axis=1) + np.diff(along_y, axis=0)
    return _by_cosines(divergence * pitch_mm, 0)


def shifted_cosine_transform(
    slope_x: np.ndarray, slope_y: np.ndarray, pitch_mm: float
) -> np.ndarray:
    """Do the same with the faults that are common in open tactile libraries.

    Wave k is divided by the eigenvalue of wave k + 1, and differences over two nodes are not
    halved: depths are too low or too high, depending on the width of the contact.
    """
    padded_x, padded_y = (np.pad(s, 1, mode="edge") for s in (slope_x, slope_y))
    divergence = padded_x[1:-1, 2:] - padded_x[1:-1, :-2] + padded_y[2:, 1:-1] - padded_y[:-2, 1:-1]
    return _by_cosines(divergence * pitch_mm, 1)


def _by_cosines(divergence: np.ndarray, shift: int) -> np.ndarray:
    waves = [4.0 * np.sin(0.5 * np.pi * (np.arange(n) + shift) / n) ** 2 for n in divergence.shape]
    eigenvalues = waves[0][:, None] + waves[1]
    eigenvalues[0, 0] = eigenvalues[0, 0] or 1.0
    spectrum = scipy.fft.dctn(-divergence, type=2, norm="ortho") / eigenvalues
    spectrum[0, 0] = 0.0
    return scipy.fft.idctn(spectrum, type=2, norm="ortho")


def frankot_chellappa(slope_x: np.ndarray, slope_y: np.ndarray, pitch_mm: float) -> np.ndarray:
    """Project the slopes on integrable ones by a Fourier transform (1988); periodic boundary."""
    rows, columns = slope_x.shape
    wave_y = 2.0 * np.pi * np.fft.fftfreq(rows, pitch_mm)[:, None]
    wave_x = 2.0 * np.pi * np.fft.rfftfreq(columns, pitch_mm)[None, :]
    square = wave_x**2 + wave_y**2
    square[0, 0] = 1.0
    spectrum = -1j * (wave_x * scipy.fft.rfft2(slope_x) + wave_y * scipy.fft.rfft2(slope_y))
    spectrum /= square
    spectrum[0, 0] = 0.0
    return scipy.fft.irfft2(spectrum, s=(rows, columns))


def sparse_quadratic(given: Scene) -> np.ndarray:
    """Solve the weighted least squares over all edges directly (Horn and Brooks 1986)."""
    nodes = np.arange(given.depth_mm.size).reshape(given.depth_mm.shape)
    edges = []
    for slope, axis in ((given.slope_x, 1), (given.slope_y, 0)):
        before, after = (
            tuple(part if k == axis else slice(None) for k in (0, 1))
            for part in (slice(None, -1), slice(1, None))
        )
        target = 0.5 * given.pitch_mm * (slope[before] + slope[after])
        weight = np.minimum(given.weight[before], given.weight[after])
        edges.append([a.ravel() for a in (nodes[before], nodes[after], target, weight)])
    first, second, target, weight = (np.concatenate(parts) for parts in zip(*edges, strict=True))
    ones, rows = np.ones(target.size), np.arange(target.size)
    values = np.concatenate([ones, -ones]), (np.tile(rows, 2), np.concatenate([second, first]))
    difference = csc_matrix(values, shape=(target.size, nodes.size))
    weighted = difference.T @ diags_array(weight)
    # A very small weight fixes the constant, and nodes without any edge.
    matrix = (weighted @ difference + 1e-9 * diags_array(np.ones(nodes.size))).tocsc()
    return spsolve(matrix, weighted @ target).reshape(nodes.shape)


def _sine(stencil: int) -> Callable[[Scene], np.ndarray]:
    def integrate(given: Scene) -> np.ndarray:
        solver = PoissonSolver(*given.depth_mm.shape, pitch_mm=given.pitch_mm, stencil=stencil)  # type: ignore[arg-type]
        return solver.integrate(given.slope_x, given.slope_y).depth_mm

    return integrate


def _weighted(given: Scene) -> np.ndarray:
    slope_x, slope_y, weight, hold = (a.astype(np.float32) for a in given[1:5])
    options = {"pitch_mm": given.pitch_mm, "hold": hold}
    return integrate_weighted(slope_x, slope_y, weight, **options).depth_mm


INTEGRATORS: dict[str, Callable[[Scene], np.ndarray]] = {
    "sine transform, 4 slopes an edge (ours, live)": _sine(4),
    "weighted conjugate gradients (ours, best)": _weighted,
    "sine transform, trapezoid": _sine(2),
    "sine transform, forward differences": _sine(1),
    "cosine transform, Neumann": lambda s: cosine_transform(s.slope_x, s.slope_y, s.pitch_mm),
    "Frankot-Chellappa": lambda s: frankot_chellappa(s.slope_x, s.slope_y, s.pitch_mm),
    "direct sparse least squares": sparse_quadratic,
    "cosine transform, wrong eigenvalues": (
        lambda s: shifted_cosine_transform(s.slope_x, s.slope_y, s.pitch_mm)
    ),
}


def error_um(name: str, given: Scene) -> float:
    """Return the mean absolute error of an integrator."""
    error = INTEGRATORS[name](given) - given.depth_mm
    return float(1e3 * np.abs(error - np.median(error)).mean())


def order(name: str, sides: Sequence[int] = SIDES) -> float:
    """Return the order of convergence on the smooth bump."""
    errors = np.array([error_um(name, scene("bump", side)) for side in sides])
    sound = errors > ROUNDING_UM
    if sound.sum() < 2:
        return float("nan")  # exact at every size
    return float(-np.polyfit(np.log(sides)[sound], np.log(errors[sound]), 1)[0])


def compare(side: int = SIDE, repeats: int = REPEATS) -> Iterator[dict[str, Any]]:
    """Yield the error on every surface, the median time and the order of each integrator."""
    scenes = {name: scene(name, side) for name in SCENES}
    for name, integrate in INTEGRATORS.items():
        errors = {f"{label} um": error_um(name, given) for label, given in scenes.items()}
        times = []
        for _ in range(repeats):
            begin = time.perf_counter()
            integrate(scenes["bump"])
            times.append(1e3 * (time.perf_counter() - begin))
        yield {"integrator": name, **errors, "ms": float(np.median(times)), "order": order(name)}


if __name__ == "__main__":
    show(compare())
