"""Find the pressed objects of a depth map without knowledge of their shape."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from scipy import ndimage

from gelpolight_core.arrays import Array, Mask
from gelpolight_core.geometry.fits import robust_sd

NOISE_FACTOR = 8.0
"""Least height of a press as a multiple of the ground's scatter. With 5 sigma, one pixel of 1e6
would exceed the limit; a map has 1e6 pixels, and its offsets are not Gaussian."""
SMALLEST_AREA_MM2 = 0.2
"""Bumps with a smaller half-height area are ignored: a pin of 0.5 mm diameter."""
SECONDARY_SHARE = 0.25
"""Bumps lower than this share of the tallest are ripples of the reconstruction, not objects."""


@dataclass(frozen=True, slots=True)
class PressedRegion:
    """One bump of the depth map.

    Attributes
    ----------
    core : (rows, columns) bool
        Where the depth is above half the bump's height.
    height_mm : float
        Robust top height above the ground.
    centre_mm : (float, float)
        Centroid of `core`, (x, y).
    area_mm2 : float
        Area of `core`.
    side_mm : (float, float)
        Sides of the smallest rectangle around `core`; the first lies along `yaw`.
    yaw : float
        Angle of the first side to the x axis, radians, in [-pi/4, pi/4].
    cut : bool
        Whether `core` touches the border of the valid map.
    """

    core: Mask
    height_mm: float
    centre_mm: tuple[float, float]
    area_mm2: float
    side_mm: tuple[float, float]
    yaw: float
    cut: bool


def ground_level_mm(depth_mm: Array, valid: Mask) -> tuple[float, float]:
    """Return the level of the untouched membrane, and its scatter (1 sigma).

    Parameters
    ----------
    depth_mm : (rows, columns)
        Depth map.
    valid : (rows, columns) bool
        Where it may be used.
    """
    values = depth_mm[valid]
    middle, lowest, extent = np.median(values), values.min(), np.ptp(values)
    low = values[values <= middle + 0.2 * extent]
    level = float(np.median(low))
    if middle > lowest + 0.05 * extent:
        # An object and its drape can cover most of the map: the ground is the most frequent depth.
        low = np.sort(values)[: max(values.size // 2, 1)]
        half = max(low.size // 2, 1)
        start = int(np.argmin(low[half - 1 :] - low[: low.size - half + 1]))
        level = float(np.median(low[start : start + half]))
    # The drape only raises the ground, so the scatter is computed from values below the level.
    below = level - low[low <= level]
    return level, robust_sd(below) if below.size else 0.0


def find_pressed_regions(
    depth_mm: Array, x_mm: Array, y_mm: Array, valid: Mask
) -> list[PressedRegion]:
    """Return the bumps of a depth map, tallest first.

    Parameters
    ----------
    depth_mm : (rows, columns)
        Depth, positive towards the camera; finite.
    x_mm, y_mm : (columns,), (rows,)
        The map's regular grid.
    valid : (rows, columns) bool
        Where the map may be used.
    """
    pitch = _pitch_mm(x_mm, y_mm)
    # Smoothing over a tenth of a millimetre removes pixel noise, but no object.
    smooth = _smoothed_over_gaps(depth_mm, valid, 0.1 / pitch)
    level, scatter = ground_level_mm(smooth, valid)
    # Missing pixels within the map are gaps, not its border.
    valid = ndimage.binary_fill_holes(valid)
    lift = np.where(valid, smooth - level, 0.0)
    peak = float(lift.max())
    least = NOISE_FACTOR * scatter
    if peak <= max(least, 1e-6):
        return []
    threshold = max(least, 0.5 * SECONDARY_SHARE * peak)
    inner = ndimage.binary_erosion(valid, border_value=0)
    regions = [
        region
        for core in _half_height_cores(lift, threshold, SMALLEST_AREA_MM2 / pitch**2)
        if (region := _describe(core, lift, x_mm, y_mm, inner)).height_mm > least
    ]
    return sorted(regions, key=lambda r: -r.height_mm)


def _smoothed_over_gaps(depth_mm: Array, valid: Mask, sigma_px: float) -> Array:
    """Return the map smoothed by a Gaussian that leaves out what is not valid."""
    side = 2 * int(4.0 * sigma_px + 0.5) + 1
    share, total = (
        cv2.GaussianBlur(values, (side, side), sigma_px, borderType=cv2.BORDER_REFLECT)
        for values in (valid.astype(np.float64), np.where(valid, depth_mm, 0.0))
    )
    return np.asarray(np.divide(total, share, out=np.zeros_like(total), where=share > 1e-6))


def _half_height_cores(lift: Array, threshold: float, least_pixels: float) -> list[Mask]:
    """Return the half-height area of every bump; bumps joined by their drapes are separated."""
    labels, count = ndimage.label(lift > threshold)
    cores: list[Mask] = []
    for label in range(1, count + 1):
        island = labels == label
        if island.sum() < least_pixels:
            continue
        top = float(np.quantile(lift[island], 0.98))
        parts, part_count = ndimage.label(island & (lift > 0.5 * top))
        for part in range(1, part_count + 1):
            core = parts == part
            if core.sum() >= least_pixels:
                cores.append(core)
    return cores


def _describe(core: Mask, lift: Array, x_mm: Array, y_mm: Array, inner: Mask) -> PressedRegion:
    pitch = _pitch_mm(x_mm, y_mm)
    rows, columns = np.nonzero(core)
    points = np.stack([x_mm[columns], y_mm[rows]], axis=1)
    (_, _), (width, height), angle = cv2.minAreaRect(points.astype(np.float32))
    yaw = np.deg2rad(angle)
    side = (width + pitch, height + pitch)
    quarter_turns = round(yaw / (np.pi / 2.0))
    if quarter_turns % 2:
        side = side[::-1]
    return PressedRegion(
        core=core,
        height_mm=float(np.quantile(lift[core], 0.8)),
        centre_mm=(float(points[:, 0].mean()), float(points[:, 1].mean())),
        area_mm2=float(core.sum()) * pitch**2,
        side_mm=side,
        yaw=float(yaw - quarter_turns * np.pi / 2.0),
        cut=bool((core & ~inner).any()),
    )


def _pitch_mm(x_mm: Array, y_mm: Array) -> float:
    return float(np.sqrt(abs(x_mm[1] - x_mm[0]) * abs(y_mm[1] - y_mm[0])))
