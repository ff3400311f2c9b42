"""Detect changes between two frames of a camera that exceed noise and flicker."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.image.noise import REPEATABILITY, pixel_noise

Frame = NDArray[Any]
Float = NDArray[np.float32]

BLOCK_PX = 8
"""Averaging over blocks of this side raises a movement above the noise of single pixels."""
NOISE_SD = 8.0
"""Bright areas have up to twice the noise of the median pixel, and some of the many blocks reach
four standard deviations: anything below eight may be noise."""

MOVING_SHARE = 0.001
"""A few blocks may vary (hot pixels, a flickering glint) although nothing moves."""


def changed_blocks(
    before: Frame, now: Frame, *, flicker: float = REPEATABILITY
) -> NDArray[np.bool_]:
    """Return which blocks of the image changed by more than noise and flicker.

    Parameters
    ----------
    before, now : (rows, columns, 3) uint8 or uint16
        Frames of the same size and bit depth.
    flicker : float, optional
        Relative change of brightness that a block may have without counting as changed.

    Returns
    -------
    (rows / 8, columns / 8)
        Blocks.
    """
    scale = np.float32(1.0 / np.iinfo(now.dtype).max)
    sigma = _noise(before, now)
    blocks, earlier = _blocks(now) * scale, _blocks(before) * scale
    limit = NOISE_SD * sigma / BLOCK_PX + np.float32(flicker) * blocks
    return np.asarray((np.abs(blocks - earlier) > limit).any(axis=2))


def moving_share(before: Frame, now: Frame) -> float:
    """Return the share of the image that changed by more than noise and flicker.

    Parameters
    ----------
    before, now : (rows, columns, 3) uint8 or uint16
        Frames of the same size and bit depth.
    """
    return float(changed_blocks(before, now).mean())


def _blocks(rgb: Frame) -> Float:
    size = (max(rgb.shape[1] // BLOCK_PX, 1), max(rgb.shape[0] // BLOCK_PX, 1))
    # Floating point: the mean of 64 pixels is finer than one grey level of the camera.
    return np.asarray(cv2.resize(rgb.astype(np.float32), size, interpolation=cv2.INTER_AREA))


def _noise(before: Frame, now: Frame) -> Float:
    """Return the standard deviation (3,) of the pixel differences; 1 is full scale.

    Every eighth pair of rows is enough; neighbouring rows stay neighbours.
    """
    rows = now.shape[0] // BLOCK_PX * BLOCK_PX
    pairs = [
        rgb[:rows].reshape(-1, BLOCK_PX, *rgb.shape[1:])[:, :2].reshape(-1, *rgb.shape[1:])
        for rgb in (before, now)
    ]
    full = np.float32(np.iinfo(now.dtype).max)
    difference = (pairs[1].astype(np.float32) - pairs[0]) / full
    return np.asarray(pixel_noise(difference, np.ones(difference.shape[:2], np.bool_)), np.float32)
