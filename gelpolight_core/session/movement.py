"""What changed between two frames of a camera by more than its noise and its light's flicker."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.reflectance.noise import REPEATABILITY, pixel_noise

Frame = NDArray[Any]
Float = NDArray[np.float32]

BLOCK_PX = 8
"""Averaging over blocks of this side lifts a movement out of the noise of single pixels."""
NOISE_SD = 8.0
"""Bright places have up to twice the noise of the median pixel, and of tens of thousands of blocks
some reach four standard deviations: below eight everything may be noise."""

MOVING_SHARE = 0.001
"""A few blocks may twinkle (hot pixels, a flickering glint) while nothing moves."""


def changed_blocks(
    before: Frame, now: Frame, *, flicker: float = REPEATABILITY
) -> NDArray[np.bool_]:
    """Return which blocks of the picture changed by more than noise and flicker.

    Parameters
    ----------
    before, now : (rows, columns, 3) uint8 or uint16
        Frames of one size and depth.
    flicker : float, optional
        Share of its brightness by which a block may change all the same.

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
    """Return which share of the picture changed between two frames by more than noise and flicker.

    Parameters
    ----------
    before, now : (rows, columns, 3) uint8 or uint16
        Frames of one size and depth.
    """
    return float(changed_blocks(before, now).mean())


def _blocks(rgb: Frame) -> Float:
    size = (max(rgb.shape[1] // BLOCK_PX, 1), max(rgb.shape[0] // BLOCK_PX, 1))
    # In floating point: the mean of 64 pixels is finer than one step of the camera.
    return np.asarray(cv2.resize(rgb.astype(np.float32), size, interpolation=cv2.INTER_AREA))


def _noise(before: Frame, now: Frame) -> Float:
    """Return the standard deviation (3,) of the difference from pixel to pixel, 1 is full scale.

    Every eighth pair of lines is enough, and neighbours stay neighbours.
    """
    rows = now.shape[0] // BLOCK_PX * BLOCK_PX
    pairs = [
        rgb[:rows].reshape(-1, BLOCK_PX, *rgb.shape[1:])[:, :2].reshape(-1, *rgb.shape[1:])
        for rgb in (before, now)
    ]
    full = np.float32(np.iinfo(now.dtype).max)
    difference = (pairs[1].astype(np.float32) - pairs[0]) / full
    return np.asarray(pixel_noise(difference, np.ones(difference.shape[:2], np.bool_)), np.float32)
