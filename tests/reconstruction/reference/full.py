"""The near-light model put together from the scalar oracles: the whole grid, without leave-outs."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray
from reference.denoise import quiet_even_parts
from reference.near_light import RaySlopes, ShadedField, solve_near_light
from reference.placement import place_on_grid, resample
from reference.weighted import integrate_weighted
from scipy.ndimage import binary_fill_holes

from gelpolight_core.lights.crosstalk import unmix
from gelpolight_core.sensor_calibration import Calibration, FullModel

Map = NDArray[np.float32]
SATURATED = 0.995
LEAST_BASE = 0.01
COARSE = 4
ROUNDS = 2


@dataclass(frozen=True)
class FullDepth:
    """Depth, normals (z < 0) and flags on the metric grid."""

    depth_mm: Map
    normals: Map
    flags: NDArray[np.uint8]


def reconstruct(
    rgb: Map, calibration: Calibration, *, denoising: bool = True, factor: int = 1
) -> FullDepth:
    """Reconstruct a linear image: two rounds at quarter scale, and one at scale `factor`."""
    full = calibration.full
    assert full is not None
    field = shaded_field(rgb, calibration, full, denoising=denoising)
    pitch = calibration.table.grid.pitch_mm
    coarse = coarsen(field, COARSE)
    depth = np.zeros(coarse.usable.shape, np.float32)
    for _ in range(ROUNDS):
        _, depth = one_round(coarse, depth, full, COARSE * pitch)
    last = field if factor == 1 else coarsen(field, factor)
    rows, columns = last.usable.shape
    start = np.asarray(cv2.resize(depth, (columns, rows), interpolation=cv2.INTER_LINEAR))
    slopes, moved = one_round(last, start, full, factor * pitch)
    column, row, _ = place_on_grid(moved, last.ray_slope, last.x_mm, last.y_mm)
    depth = resample(moved, column, row)
    normals = np.stack(
        [resample(np.ascontiguousarray(slopes.normals[..., k]), column, row) for k in range(3)],
        axis=-1,
    )
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    flags = resample(slopes.flags.astype(np.float32), column, row, nearest=True).astype(np.uint8)
    depth[(flags & 1) != 0] = 0.0
    return FullDepth(depth, normals, flags)


def one_round(
    field: ShadedField, depth_mm: Map, full: FullModel, pitch_mm: float
) -> tuple[RaySlopes, Map]:
    """Return slopes at the present depth, and the depth that they give."""
    slopes = solve_near_light(field, depth_mm, full.led_positions_mm, full.membrane)
    solved = integrate_weighted(
        slopes.slope_x, slopes.slope_y, slopes.weight, pitch_mm=pitch_mm, start_mm=depth_mm
    )
    return slopes, solved.depth_mm


def shaded_field(
    rgb: Map, calibration: Calibration, full: FullModel, *, denoising: bool = True
) -> ShadedField:
    """Resample a linear image and compare it with the background."""
    table = calibration.table
    seen = table.apply(rgb)
    bad = ~np.isfinite(seen)
    seen[bad] = 0.0
    light = unmix(seen, calibration.crosstalk)
    missing = bad | (table.apply((rgb >= SATURATED).astype(np.float32)) > 0.0)
    base = np.maximum(full.background, LEAST_BASE)
    usable = table.valid & (full.background > LEAST_BASE).all(axis=2)
    usable &= (calibration.factors > 0.0).all(axis=2)
    sigma = (calibration.noise / np.sqrt(2.0) / base).astype(np.float32)
    ratio = np.asarray(light / base, np.float32)
    if denoising:
        ratio, sigma = quiet_even_parts(light, base, sigma, usable)
    ratio = np.where(usable[..., None], ratio, 1.0).astype(np.float32)
    grid = table.grid
    return ShadedField(
        ratio,
        sigma,
        np.zeros_like(ratio),  # the oracle is for membranes that give no light to themselves
        missing,
        usable,
        np.asarray(binary_fill_holes(usable)),
        table.ray_slope,
        grid.x_mm,
        grid.y_mm,
    )


def coarsen(field: ShadedField, factor: int) -> ShadedField:
    """Average the field over blocks of nodes; a block counts where all of it does."""
    rows, columns = (n // factor for n in field.usable.shape)

    def average(values: Map) -> Map:
        whole = np.ascontiguousarray(values[: rows * factor, : columns * factor], np.float32)
        return np.asarray(cv2.resize(whole, (columns, rows), interpolation=cv2.INTER_AREA))

    def middle(axis_mm: NDArray[np.float64], count: int) -> NDArray[np.float64]:
        return np.asarray(axis_mm[: count * factor].reshape(count, factor).mean(axis=1))

    return ShadedField(
        average(field.ratio),
        average(field.sigma) / np.float32(factor),
        average(field.around),
        average(field.saturated.astype(np.float32)) > 0.5,
        average(field.usable.astype(np.float32)) > 0.99,
        average(field.inside.astype(np.float32)) > 0.5,
        average(field.ray_slope),
        middle(field.x_mm, columns),
        middle(field.y_mm, rows),
    )
