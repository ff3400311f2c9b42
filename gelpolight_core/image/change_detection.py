"""Detection of changes in time: images, the light of a camera, the dent of a press.

A level has changed if it differs by more than its noise, and by more than two images of the same
scene differ anyway.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np

from gelpolight_core.base.arrays import BoolArray, Float32Array, Float64Array, FrameArray

from .scaled_difference import DARK, REPEATABILITY, pixel_noise

SIGMAS = 4.0
"""Exceeded by chance, upwards, by one of 30,000 levels."""
LASTS_S = 0.5
"""What lasts so long is a state; hands and released objects shake for a few tenths of a second."""
NEVER_S = (math.inf, -math.inf)
"""An empty range of times."""
BLOCK_PX = 8
"""Averaging over blocks of this side raises a movement above the noise of single pixels."""
STILL_SHARE = 0.001
"""A few blocks may vary (hot pixels, a flickering glint) although nothing moves."""
CONTACT_CHANGE = 0.06
"""The walls of a press change the light by tens of percent, warming LEDs by one or two."""
PRESSED_SHARE = 0.004
"""A cylinder of 3 mm and 0.5 mm height changes a hundredth of an image 30 mm wide."""
FLICKER = 0.06
"""Two images of the same may differ by this share of their light. Their mean is then off by half of
it, which is as well as the reflectance of a white board is known."""
UNSTEADY_PX = 2
"""... and by this movement. Their mean is then off by half of it, which changes the height of a
press by less than 2 %."""


def changed_mask(
    before: FrameArray, now: FrameArray, sd: FrameArray | float, tolerance: float = REPEATABILITY
) -> BoolArray:
    """Return which levels have changed.

    Parameters
    ----------
    before, now : ndarray
        Levels of the same shape.
    sd : ndarray or float
        Standard deviation of their difference without a change.
    tolerance : float, optional
        Relative change that does not count.
    """
    return np.asarray(np.abs(now - before) > SIGMAS * sd + tolerance * np.abs(now))


def straight_line(levels: Float64Array, times_s: Float64Array) -> tuple[Float64Array, Float64Array]:
    """Return the change of levels from the first to the last time with the scatter about it.

    Parameters
    ----------
    levels : (times, ...) float64
        At least three.
    times_s : (times,) float64
        Their times.

    Returns
    -------
    change, scatter : (...) float64
        By a fitted straight line; standard deviation of the levels about it.
    """
    centred = (times_s - times_s.mean()) / max(float(np.ptp(times_s)), 1e-9)
    change = np.tensordot(centred, levels, 1) / max(float(centred @ centred), 1e-9)
    residual = levels - levels.mean(axis=0) - np.multiply.outer(centred, change)
    return change, np.sqrt((residual**2).sum(axis=0) / (len(levels) - 2))


def changed_blocks(
    before: FrameArray, now: FrameArray, *, tolerance: float = REPEATABILITY
) -> BoolArray:
    """Return which blocks (rows / 8, columns / 8) of an image have changed.

    Parameters
    ----------
    before, now : (rows, columns, 3) uint8 or uint16
        Frames of the same size and bit depth.
    tolerance : float, optional
        Relative change of brightness that does not count.
    """
    scale = np.float32(1.0 / np.iinfo(now.dtype).max)
    rows = np.linspace(0, len(now) - 2, 16).astype(int)
    rows = np.stack([rows, rows + 1], axis=1).ravel()
    difference = scale * (now[rows].astype(np.float32) - before[rows])
    sd = pixel_noise(difference, np.ones(difference.shape[:2], np.bool_))
    # Of the colours of most cameras, one pixel in four is measured and the others interpolated.
    sd *= np.float32(2.0 / BLOCK_PX)
    blocks = scale * _blocks(before), scale * _blocks(now)
    return np.asarray(changed_mask(*blocks, sd, tolerance).any(axis=2))


def changed_share(before: FrameArray, now: FrameArray) -> float:
    """Return the share of an image that has changed: up to `STILL_SHARE` nothing moves.

    Parameters
    ----------
    before, now : (rows, columns, 3) uint8 or uint16
        Frames of the same size and bit depth.
    """
    return float(changed_blocks(before, now).mean())


def press_differs(before: FrameArray, now: FrameArray) -> bool:
    """Return whether an object was pressed in, lifted or moved between two frames.

    It is recognised by the walls of the press, which needs no calibration and keeps up with the
    camera.

    Parameters
    ----------
    before, now : (rows, columns, 3) uint8 or uint16
        Frames of the same size and bit depth.
    """
    blocks = changed_blocks(before, now, tolerance=CONTACT_CHANGE)
    return float(blocks.mean()) >= PRESSED_SHARE


def find_odd_image(images: Sequence[Float32Array], *, loss: float = 0.0) -> tuple[int, int] | None:
    """Return the image of one view that does not show the same as the others, or None.

    Noise, flicker of the light, a small movement, hot pixels and specks do not count.

    Parameters
    ----------
    images : sequence of (rows, columns, 3) float32
        Linear light 0..1, all of the same size.
    loss : float, optional
        Standard deviation of a value by the compression of the files, as a share of full scale.

    Returns
    -------
    (int, int) or None
        Its index, and that of the image from which it differs most.
    """
    means = [_block_means(image) for image in images]
    total = np.asarray(np.sum(means, axis=0), np.float32)
    rest = np.float32(1.0 / (len(images) - 1))
    shares = [_differing_share(mean, rest * (total - mean), loss) for mean in means]
    odd = int(np.argmax(shares))
    if shares[odd] <= STILL_SHARE:
        return None
    return odd, int(np.argmax([_differing_share(means[odd], mean, loss) for mean in means]))


def _differing_share(means: Float32Array, others: Float32Array, loss: float) -> float:
    """Return the share of the lit blocks that differ, from the mean light about each pixel."""
    around, middles = np.ones((1 + UNSTEADY_PX,) * 2, np.uint8), slice(2, None, BLOCK_PX // 2)
    # As bright as it may be after a movement.
    low, high = cv2.erode(others, around), cv2.dilate(others, around)
    light, expected, low, high = (m[middles, middles] for m in (means, others, low, high))
    brightest = np.maximum(light, high)
    lit = np.asarray(brightest > DARK)
    any_lit: BoolArray = np.asarray(lit.any(axis=2))
    # Compression changes the values of a block independently of each other, by its cosines.
    sd = np.hypot(pixel_noise(light - expected, any_lit), loss / BLOCK_PX)
    outside = np.maximum(low - light, light - high)
    beyond = outside > SIGMAS * sd + FLICKER * brightest
    changed = int(np.count_nonzero((beyond & lit).any(axis=2)))
    # Of the few lit blocks of a mirror, one may vary by hot pixels beside each other.
    return (changed - 1) / max(int(np.count_nonzero(any_lit)), 1)


def _block_means(image: Float32Array) -> Float32Array:
    """Return the mean light of a block about each pixel of the image at half of its size."""
    beside = np.array([[1, 1, 1], [1, 0, 1], [1, 1, 1]], np.uint8)
    # Hot pixels are brighter than all neighbours.
    clipped = np.clip(image, cv2.erode(image, beside), cv2.dilate(image, beside))
    rows, columns = image.shape[:2]
    size = max(columns // 2, 1), max(rows // 2, 1)
    half = cv2.resize(clipped, size, interpolation=cv2.INTER_AREA)
    return np.asarray(cv2.blur(half, (BLOCK_PX // 2,) * 2), np.float32)


def _blocks(rgb: FrameArray) -> FrameArray:
    rows, columns = rgb.shape[:2]
    # Rounding of the first step is below the noise; of both it would not be.
    half = cv2.resize(rgb, (columns // 2, rows // 2), interpolation=cv2.INTER_AREA)
    size = max(columns // BLOCK_PX, 1), max(rows // BLOCK_PX, 1)
    return cv2.resize(half.astype(np.float32), size, interpolation=cv2.INTER_AREA)


class Debouncer:
    """Timer of how long something is true without a break, up to `LASTS_S`."""

    def __init__(self) -> None:
        self._since_s: float | None = None

    def update(self, true: bool, time_s: float) -> float:
        """Add a state at a time and return the share of `LASTS_S` that it has lasted."""
        if not true:
            self._since_s = None
            return 0.0
        if self._since_s is None or time_s < self._since_s:
            self._since_s = time_s
        return min((time_s - self._since_s) / LASTS_S, 1.0)


class StillnessDetector:
    """Detector of movement in the frames of a camera.

    Attributes
    ----------
    moved : bool
        Whether something has moved between two frames since this was set to False.
    still_s : (float, float)
        Times of the first and the last frame without movement. Empty (inf, -inf) while it moves.
    """

    def __init__(self) -> None:
        self.moved = False
        self.restart()

    def restart(self) -> None:
        """Begin again with another camera."""
        self.still_s = NEVER_S
        self._before: FrameArray | None = None
        self._still = Debouncer()

    def update(self, rgb: FrameArray, time_s: float) -> float:
        """Add a frame at a time and return the share of `LASTS_S` without movement."""
        before, self._before = self._before, rgb
        still = False
        if before is not None and before.shape == rgb.shape and before.dtype == rgb.dtype:
            still = changed_share(before, rgb) <= STILL_SHARE
            self.moved = self.moved or not still
        self.still_s = (min(self.still_s[0], time_s), time_s) if still else NEVER_S
        return self._still.update(still, time_s)
