"""Is the picture still? For a capture that waits until nothing moves."""

from __future__ import annotations

import math

import cv2
import numpy as np
from numpy.typing import NDArray

from app.live.picture_checks import Rgb, end_of_scale
from gelpolight_core.reflectance.noise import REPEATABILITY, pixel_noise

Float = NDArray[np.float32]

# Averaging over blocks of this side lifts a movement out of the noise of single pixels.
BLOCK_PX = 8
# Bright places have up to twice the noise of the median pixel, and of tens of thousands of blocks
# some reach four standard deviations: below eight everything may be noise.
NOISE_SD = 8.0
# A few blocks may twinkle (hot pixels, a flickering glint) while nothing moves.
MOVING_SHARE = 0.001
# A hand that lets go shakes for a few tenths of a second.
STILL_S = 0.5
# Counted in time, as detection sees two frames a second or thirty; but never by a single pair.
STILL_FRAMES = 3


def moving_share(before: Rgb, now: Rgb) -> float:
    """Return which share of the picture changed between two frames by more than noise and flicker.

    Parameters
    ----------
    before, now : (rows, columns, 3)
        Frames of one size and depth.
    """
    scale = np.float32(1.0 / end_of_scale(now))
    sigma = _noise(before, now) * scale
    blocks = _blocks(now) * scale
    change = np.abs(blocks - _blocks(before) * scale)
    limit = NOISE_SD * sigma / BLOCK_PX + REPEATABILITY * blocks
    return float((change > limit).any(axis=2).mean())


def _blocks(rgb: Rgb) -> Float:
    size = (max(rgb.shape[1] // BLOCK_PX, 1), max(rgb.shape[0] // BLOCK_PX, 1))
    # In floating point: the mean of 64 pixels is finer than one step of the camera.
    return np.asarray(cv2.resize(rgb.astype(np.float32), size, interpolation=cv2.INTER_AREA))


def _noise(before: Rgb, now: Rgb) -> Float:
    """Return the standard deviation (3,) of the difference from pixel to pixel, in file numbers.

    Every eighth pair of lines is enough, and neighbours stay neighbours.
    """
    rows = now.shape[0] // BLOCK_PX * BLOCK_PX
    pairs = [
        rgb[:rows].reshape(-1, BLOCK_PX, *rgb.shape[1:])[:, :2].reshape(-1, *rgb.shape[1:])
        for rgb in (before, now)
    ]
    difference = (pairs[1].astype(np.float32) - pairs[0]) / np.float32(end_of_scale(now))
    sigma = pixel_noise(difference, np.ones(difference.shape[:2], np.bool_))
    return np.asarray(sigma * end_of_scale(now), np.float32)


class Still:
    """Watches consecutive frames and says when nothing has moved for a while."""

    def __init__(self, still_s: float = STILL_S) -> None:
        self._still_s = still_s
        self._before: Rgb | None = None
        self._quiet, self._since_s = 0, 0.0
        self.moving = math.nan

    def update(self, rgb: Rgb, time_s: float) -> bool:
        """Take in the next frame and when it was made; return whether the last were all alike."""
        before, self._before = self._before, rgb
        alike = before is not None and before.shape == rgb.shape and before.dtype == rgb.dtype
        if before is not None and alike:
            self.moving = moving_share(before, rgb)
            alike = self.moving <= MOVING_SHARE
        if not alike:
            self._quiet, self._since_s = 0, time_s
            return False
        self._quiet += 1
        return self._quiet >= STILL_FRAMES and time_s - self._since_s >= self._still_s

    @property
    def moves(self) -> bool:
        """Whether something moved between the last two frames; not where there are none."""
        return self.moving > MOVING_SHARE
