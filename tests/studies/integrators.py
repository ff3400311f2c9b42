"""Error of integrators on a surface with an exact formula.

    python -m tests.studies.integrators

Each takes d(depth)/dx and d(depth)/dy of a smooth bump, whole or cut by the border, and returns the
depth. Errors are absolute, without their median.
"""

from collections.abc import Callable, Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
import scipy.fft

from gelpolight_core.reconstruction.integration.weighted import integrate_weighted
from tests.slopes import exact_solution, integrate_slopes
from tests.studies.presses import show

WIDTH_MM, CUT_MM = 10.0, 4.6
SIDES = (40, 80, 160)


class Scene(NamedTuple):
    """Exact depth and slopes (side, side), weight, and hold: 0 at a cut."""

    depth_mm: np.ndarray
    slope_x: np.ndarray
    slope_y: np.ndarray
    weight: np.ndarray
    hold: np.ndarray
    pitch_mm: float


def _bump(x: np.ndarray, y: np.ndarray, x_mm: float = 0.0) -> tuple[np.ndarray, ...]:
    depth = np.exp(-((x - x_mm) ** 2 + y**2) / 1.4)
    return depth, -2.0 / 1.4 * (x - x_mm) * depth, -2.0 / 1.4 * y * depth


def scene(side: int, x_mm: float = 0.0) -> Scene:
    """Return the bump with `side` nodes along each axis; the border may cut it."""
    pitch = WIDTH_MM / side
    axis = (np.arange(side) - 0.5 * (side - 1)) * pitch
    depth, *slopes = _bump(*np.meshgrid(axis + 0.03, axis - 0.02), x_mm)
    hold = np.where(depth > 1e-3, 0.0, 1.0) if x_mm else np.ones_like(depth)
    return Scene(depth, *slopes, np.ones_like(depth), hold, pitch)


def shifted_cosine_transform(
    slope_x: np.ndarray, slope_y: np.ndarray, pitch_mm: float
) -> np.ndarray:
    """Solve the Poisson equation by a DCT with the faults that open tactile libraries share.

    Wave k is divided by the eigenvalue of wave k + 1, and differences over two nodes are not
    halved: depths are too low or too high, depending on the width of the contact.
    """
    padded_x, padded_y = (np.pad(s, 1, mode="edge") for s in (slope_x, slope_y))
    divergence = padded_x[1:-1, 2:] - padded_x[1:-1, :-2] + padded_y[2:, 1:-1] - padded_y[:-2, 1:-1]
    waves = [4.0 * np.sin(0.5 * np.pi * (np.arange(n) + 1) / n) ** 2 for n in divergence.shape]
    spectrum = scipy.fft.dctn(-pitch_mm * divergence, type=2, norm="ortho")
    spectrum /= waves[0][:, None] + waves[1]
    spectrum[0, 0] = 0.0
    return scipy.fft.idctn(spectrum, type=2, norm="ortho")


def _low_order(given: Scene, before: float) -> np.ndarray:
    """Integrate by sine transforms with edges of two slopes: `before` of the first, and the rest.

    Along each axis an edge is the difference of two depths. The outermost ones are half as long,
    and the transform doubles them.
    """
    field = np.zeros_like(given.depth_mm)
    for slope, axis in ((given.slope_x, 1), (given.slope_y, 0)):
        padded = np.moveaxis(np.pad(slope, 1, mode="edge"), axis, -1)[1:-1]
        edges = before * padded[:, :-1] + (1.0 - before) * padded[:, 1:]
        field += np.moveaxis(np.diff(edges, axis=-1), -1, axis)
    return exact_solution(field, given.pitch_mm)


def _weighted(given: Scene) -> np.ndarray:
    slope_x, slope_y, weight, hold = (a.astype(np.float32) for a in given[1:5])
    options = {"pitch_mm": given.pitch_mm, "hold": hold}
    return integrate_weighted(slope_x, slope_y, weight, **options).depth_mm


INTEGRATORS: dict[str, Callable[[Scene], np.ndarray]] = {
    "sine transform, 4 slopes an edge (ours, live)": (
        lambda s: integrate_slopes(s.slope_x, s.slope_y, pitch_mm=s.pitch_mm)
    ),
    "weighted conjugate gradients (ours, best)": _weighted,
    "sine transform, trapezoid": partial(_low_order, before=0.5),
    "sine transform, forward differences": partial(_low_order, before=1.0),
    "cosine transform, wrong eigenvalues": (
        lambda s: shifted_cosine_transform(s.slope_x, s.slope_y, s.pitch_mm)
    ),
}


def error_um(name: str, given: Scene) -> float:
    """Return the mean absolute error of an integrator."""
    error = INTEGRATORS[name](given) - given.depth_mm
    return float(1e3 * np.abs(error - np.median(error)).mean())


def order(name: str, sides: Sequence[int] = SIDES) -> float:
    """Return the order of convergence on the bump."""
    errors = [error_um(name, scene(side)) for side in sides]
    return float(-np.polyfit(np.log(sides), np.log(errors), 1)[0])


if __name__ == "__main__":
    show(
        {
            "integrator": name,
            "bump um": error_um(name, scene(SIDES[-1])),
            "cut um": error_um(name, scene(SIDES[-1], CUT_MM)),
            "order": order(name),
        }
        for name in INTEGRATORS
    )
