"""The membrane's reflectance factor: smooth variation and specks."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter

from gelpolight_core.base.arrays import Float64Array

from .design_parts import MembraneDesign

FACTOR_PITCH_MM = 0.025


def reflectance_factor(
    membrane: MembraneDesign, rng: np.random.Generator
) -> tuple[Float64Array, float, float, float]:
    """Return the reflectance factor over the membrane.

    Parameters
    ----------
    membrane : MembraneDesign
        Properties of its variation and specks.
    rng : Generator
        Source of the pattern.

    Returns
    -------
    factor : (cells, cells)
        Factor around 1.
    first_mm, pitch_mm : float
        Position of the first cell in x and y, and the cell size.
    rim_mm : float
        Radius of the working circle.
    """
    rim = 0.5 * membrane.working_diameter_mm
    count = int(np.ceil((rim + 0.5) / FACTOR_PITCH_MM))
    cells = FACTOR_PITCH_MM * np.arange(-count, count + 1, dtype=np.float64)
    factor = np.ones((cells.size, cells.size))
    if membrane.variation > 0.0:
        factor += membrane.variation * _smooth(cells.size, membrane.variation_scale_mm, rng)
    for _ in range(membrane.speck_count):
        _add_speck(factor, cells, rim, rng)
    return np.clip(factor, 0.05, None), float(cells[0]), FACTOR_PITCH_MM, rim


def even_factor(membrane: MembraneDesign) -> tuple[Float64Array, float, float, float]:
    """Return a factor of 1 in the format of :func:`reflectance_factor`.

    Parameters
    ----------
    membrane : MembraneDesign
        With the diameter of the working circle.
    """
    rim = 0.5 * membrane.working_diameter_mm
    return np.ones((2, 2)), -2.0 * rim, 4.0 * rim, rim


def _smooth(size: int, scale_mm: float, rng: np.random.Generator) -> Float64Array:
    """Return a random field of unit variance that varies over `scale_mm`."""
    # Drawn on a lattice much finer than the variation, then interpolated linearly.
    step = max(1, int(scale_mm / FACTOR_PITCH_MM / 12))
    coarse = rng.standard_normal((size // step + 2, size // step + 2))
    sigma = scale_mm / (2.0 * FACTOR_PITCH_MM * step)
    coarse = gaussian_filter(coarse, sigma, mode="wrap")
    coarse /= max(float(coarse.std()), 1e-12)
    position = np.arange(size) / step
    i, a = position.astype(int), position % 1.0
    rows = coarse[i] * (1.0 - a)[:, None] + coarse[i + 1] * a[:, None]
    return np.asarray(rows[:, i] * (1.0 - a) + rows[:, i + 1] * a)


def _add_speck(
    factor: Float64Array, cells: Float64Array, rim: float, rng: np.random.Generator
) -> None:
    radius = rng.uniform(0.04, 0.12)
    from_axis, angle = rim * np.sqrt(rng.uniform()), rng.uniform(0.0, 2.0 * np.pi)
    x, y = from_axis * np.cos(angle), from_axis * np.sin(angle)
    strength = rng.uniform(-0.5, -0.2) if rng.uniform() < 0.8 else rng.uniform(0.1, 0.25)
    i = slice(*np.searchsorted(cells, (y - 4 * radius, y + 4 * radius)))
    j = slice(*np.searchsorted(cells, (x - 4 * radius, x + 4 * radius)))
    distance = np.hypot(cells[None, j] - x, cells[i, None] - y) / radius
    factor[i, j] *= 1.0 + strength * np.exp(-(distance**4))
