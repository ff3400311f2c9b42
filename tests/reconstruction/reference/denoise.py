"""Plain NumPy oracle of the denoising: quiet the even parts, leave the edges alone.

A normal is not a linear function of the image: near an LED's mirror image a channel hardly
changes with the slope, and noise there tilts the surface to one side instead of both. Averaging a
few pixels before the solve takes that away; on walls and edges, where averaging would cost
sharpness and the signal is strong, the image is used as it is.
"""

from __future__ import annotations

import cv2
import numpy as np
from numpy.typing import NDArray

Map = NDArray[np.float32]
QUIET_PX = 1.2
WIDER_PX = (2.4, 4.8, 9.6)
THIN = 3
LEAST = np.float32(1e-9)
# Relative noise below which the curvature of normals over brightness tilts nothing that shows.
CALM = 0.01
SIGNIFICANT = 4.0


def quiet_even_parts(
    light: Map, background: Map, sigma: Map, usable: NDArray[np.bool_]
) -> tuple[Map, Map]:
    """Return press over background with its even parts averaged, and the noise that is left.

    Press and background are averaged alike, so that neither the fall of the light nor a speck of
    the membrane shows in their ratio. Where little light leaves more noise than `CALM`, wider
    averages are taken, as far as the image is even over them.

    Parameters
    ----------
    light, background : (rows, columns, 3) float32
        Linear light, the background above 0.
    sigma : (rows, columns, 3) float32
        Standard deviation of their ratio's noise.
    usable : (rows, columns) bool
        Nodes with light and membrane; the noise is measured there.

    Returns
    -------
    ratio, sigma : (rows, columns, 3) float32
        Averaged, and its standard deviation.
    """
    ratio = np.asarray(light / background, np.float32)
    if not usable.any():
        return np.asarray(ratio, np.float32), np.asarray(sigma, np.float32)
    noise = sigma
    seen = usable[..., None].astype(np.float32)
    light, background = light * seen, background * seen
    own = _noise(light, usable)
    for width_px in (QUIET_PX, *WIDER_PX):
        need = np.float32(1.0)
        if width_px > QUIET_PX:
            need = np.clip(noise / np.float32(CALM) - np.float32(1.0), 0.0, 1.0)
            need[~usable] = 0.0
            if not need.any():
                break
        quiet, edge = _quieted(light, background, usable, width_px, own)
        share = (np.float32(1.0) - edge)[..., None] * need
        ratio = ratio + share * (quiet - ratio)
        left = np.float32(1.0 / (2.0 * np.sqrt(np.pi) * width_px))
        noise = noise + share * (sigma * left - noise)
    return np.asarray(ratio, np.float32), np.asarray(noise, np.float32)


def _noise(light: Map, usable: NDArray[np.bool_]) -> tuple[Map, Map]:
    """Return a pixel's noise as variance without light, and per unit of light, (3,) each.

    Robust, from the darker and the brighter third of what is usable.
    """
    thin = usable[::THIN, ::THIN]
    if not thin.any():
        return np.full(3, LEAST, np.float32), np.zeros(3, np.float32)
    seen = light[::THIN, ::THIN][thin]
    off = np.abs(seen - _average(light, QUIET_PX)[::THIN, ::THIN][thin])
    dark, bright = np.percentile(seen, [33.0, 67.0], axis=0)
    read, shot = np.zeros(3, np.float32), np.zeros(3, np.float32)
    for k in range(3):
        low, high = seen[:, k] <= dark[k], seen[:, k] >= bright[k]
        variance = [(1.4826 * np.median(off[part, k])) ** 2 for part in (low, high)]
        level = [np.median(seen[part, k]) for part in (low, high)]
        shot[k] = max((variance[1] - variance[0]) / max(level[1] - level[0], LEAST), 0.0)
        read[k] = max(variance[0] - shot[k] * level[0], LEAST)
    return read, shot


def _quieted(
    light: Map,
    background: Map,
    usable: NDArray[np.bool_],
    width_px: float,
    noise: tuple[Map, Map],
) -> tuple[Map, Map]:
    """Return the averaged ratio, and how far (rows, columns) it is to be left as it is, 0..1."""
    wide_px = 2.0 * width_px
    below = np.maximum(_average(background, width_px), LEAST)
    average = _average(light, width_px)
    quiet = np.asarray(average / below, np.float32)
    wide = _average(light, wide_px) / np.maximum(_average(background, wide_px), LEAST)
    read, per_light = noise
    local = np.sqrt(read + per_light * np.maximum(average, np.float32(0.0))) / below
    # White noise of sd 1 leaves this much between the two averages.
    left = np.sqrt(1.0 / width_px**2 + 1.0 / wide_px**2 - 4.0 / (width_px**2 + wide_px**2))
    limit = np.float32(SIGNIFICANT * left / np.sqrt(4.0 * np.pi)) * local
    excess = (np.abs(quiet - wide) / limit).max(axis=2) - 1.0
    edge = np.where(usable, np.clip(excess, 0.0, 1.0), 0.0).astype(np.float32)
    reach = 2 * round(2.0 * width_px / QUIET_PX) + 1
    grown = cv2.dilate(edge, np.ones((reach, reach), np.uint8))
    return quiet, _average(np.asarray(grown, np.float32), 1.5 * width_px / QUIET_PX)


def _average(light: Map, width_px: float) -> Map:
    """Return the average over a Gaussian; wide ones are taken over blocks of pixels."""
    block = int(width_px / QUIET_PX / 2.0)
    if block < 2:
        return np.asarray(cv2.GaussianBlur(light, (0, 0), width_px), np.float32)
    rows, columns = light.shape[:2]
    size = (-(-columns // block), -(-rows // block))
    small = cv2.resize(light, size, interpolation=cv2.INTER_AREA)
    # The blocks themselves average already.
    spread_px = np.sqrt(width_px**2 - (block**2 - 1.0) / 12.0) / block
    small = cv2.GaussianBlur(small, (0, 0), float(spread_px))
    return np.asarray(cv2.resize(small, (columns, rows), interpolation=cv2.INTER_LINEAR))
