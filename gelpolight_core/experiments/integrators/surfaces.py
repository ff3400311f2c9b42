"""Surfaces whose depth and slopes are formulas, for comparing integrators."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.translation import tr

Array = NDArray[np.float64]
WIDTH_MM = 10.0
NOISE = 0.02
HOLES_MM = ((0.8, 0.6, 0.5), (-1.2, 0.4, 0.6), (0.2, -1.3, 0.4), (-0.9, -1.1, 0.5))


@dataclass(frozen=True, slots=True)
class Surface:
    """A surface on a square grid.

    Attributes
    ----------
    name, label : str
        For files and people.
    depth_mm, slope_x, slope_y : (side, side)
        Exact.
    weight : (side, side)
        1, or 0 where the slope is unknown; slopes are 0 there.
    hold : (side, side)
        1, or 0 next to a border that the surface crosses.
    pitch_mm : float
        Distance between nodes.
    """

    name: str
    label: str
    depth_mm: Array
    slope_x: Array
    slope_y: Array
    weight: Array
    hold: Array
    pitch_mm: float


def surface(name: str, side: int) -> Surface:
    """Return one of :data:`SURFACES` with `side` nodes along each axis."""
    label, make = SURFACES[name]
    pitch = WIDTH_MM / side
    axis = (np.arange(side) - 0.5 * (side - 1)) * pitch
    x, y = np.meshgrid(axis + 0.03, axis - 0.02)
    depth, slope_x, slope_y = make(x, y)
    even = np.ones_like(x)
    made = Surface(name, label, depth, slope_x, slope_y, even, even, pitch)
    if name == "cut":
        return replace(made, hold=np.where(depth > 1e-3, 0.0, 1.0))
    if name == "holes":
        lost = np.zeros(x.shape, bool)
        for hole_x, hole_y, radius in HOLES_MM:
            lost |= np.hypot(x - hole_x, y - hole_y) < radius
        known = np.where(lost, 0.0, 1.0)
        return replace(made, weight=known, slope_x=slope_x * known, slope_y=slope_y * known)
    if name == "noise":
        noise = NOISE * np.random.default_rng(0).standard_normal((2, side, side))
        return replace(made, slope_x=slope_x + noise[0], slope_y=slope_y + noise[1])
    return made


def _bump(x: Array, y: Array, *, x_mm: float = 0.0) -> tuple[Array, Array, Array]:
    depth = np.exp(-((x - x_mm) ** 2 + y**2) / 1.4)
    return depth, -2.0 / 1.4 * (x - x_mm) * depth, -2.0 / 1.4 * y * depth


def _cut(x: Array, y: Array) -> tuple[Array, Array, Array]:
    return _bump(x, y, x_mm=4.6)


def _walls(x: Array, y: Array) -> tuple[Array, Array, Array]:
    """Return a round plateau of 1 mm with walls of up to 76 degrees."""
    width, radius = 0.125, np.maximum(np.hypot(x, y), 1e-9)
    rise = np.tanh((2.0 - radius) / width)
    fall = -0.5 * (1.0 - rise**2) / width
    return 0.5 * (1.0 + rise), fall * x / radius, fall * y / radius


def _free_form(x: Array, y: Array) -> tuple[Array, Array, Array]:
    """Return waves that fade towards the border."""
    fade = np.exp(-(x**2 + y**2) / 3.0)
    wave = 0.6 + 0.3 * np.sin(2.1 * x + 0.4) * np.cos(1.7 * y) + 0.1 * np.sin(3.0 * y - x)
    along_x = 0.63 * np.cos(2.1 * x + 0.4) * np.cos(1.7 * y) - 0.1 * np.cos(3.0 * y - x)
    along_y = -0.51 * np.sin(2.1 * x + 0.4) * np.sin(1.7 * y) + 0.3 * np.cos(3.0 * y - x)
    slope_x = fade * (along_x - 2.0 / 3.0 * x * wave)
    return fade * wave, slope_x, fade * (along_y - 2.0 / 3.0 * y * wave)


def _wedge(x: Array, y: Array) -> tuple[Array, Array, Array]:
    """Return a ramp with three vertical sides, which no slope shows."""
    on = (np.abs(y) < 2.0) & (np.abs(x) < 3.0)
    return np.where(on, 0.4 * (x + 3.0), 0.0), np.where(on, 0.4, 0.0), np.zeros_like(x)


def _dome(x: Array, y: Array) -> tuple[Array, Array, Array]:
    """Return a hemisphere. No image shows its vertical edge."""
    square = x**2 + y**2
    on = square < 2.9**2
    z = np.sqrt(np.maximum(9.0 - square, 1e-3))
    return np.where(on, z, 0.0), np.where(on, -x / z, 0.0), np.where(on, -y / z, 0.0)


def _half_wall(x: Array, y: Array) -> tuple[Array, Array, Array]:
    """Return two levels: joined by a ramp along one part, by a vertical wall along the other."""
    high = x > 0.0
    rise = np.clip((y + 3.0) / 3.0, 0.0, 1.0)
    ramp = high & (y > -3.0) & (y < 0.0)
    return np.where(high, 0.8 * rise, 0.0), np.zeros_like(x), np.where(ramp, 0.8 / 3.0, 0.0)


SURFACES: dict[str, tuple[str, Callable[[Array, Array], tuple[Array, Array, Array]]]] = {
    "bump": (tr("smooth bump"), _bump),
    "free_form": (tr("free form"), _free_form),
    "walls": (tr("plateau with walls of 76 degrees"), _walls),
    "cut": (tr("bump cut by the border"), _cut),
    "holes": (tr("bump with holes in the slopes"), _bump),
    "noise": (tr("bump with noise of 0.02 in the slopes"), _bump),
    "wedge": (tr("ramp with vertical sides"), _wedge),
    "dome": (tr("hemisphere"), _dome),
    "half_wall": (tr("two levels, a ramp and a vertical wall"), _half_wall),
}
