"""Checks of sharpness and exposure, and stripes on saturated pixels, without Qt."""

from __future__ import annotations

import math
from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import PixelArray
from gelpolight_core.base.finding import Finding, Verdict

# A twentieth of a percent may be glints and hot pixels, which do not show the exposure.
SATURATED_WARN = 0.0005
# Core stages fail from a few percent on; at one percent the user should act.
SATURATED_FAIL = 0.01
# Eight bits below a quarter of the scale leave fewer than 64 grey levels.
DARK_SHARE_OF_SCALE = 0.25
# A mirror spot may be a dozen pixels in a million, and the only content to expose for; hot pixels
# at a short exposure are fewer.
BRIGHTEST_PIXELS = 12
# Seconds in which an old best focus loses half of its lead.
BEST_HALF_LIFE_S = 20.0


def end_of_scale(rgb: PixelArray) -> int:
    """Return the largest value that an image's pixels can have."""
    return int(np.iinfo(rgb.dtype).max)


def brightest_channel(rgb: PixelArray) -> PixelArray:
    """Return the largest of the three channels at every pixel, (rows, columns)."""
    return np.maximum(np.maximum(rgb[..., 0], rgb[..., 1]), rgb[..., 2])


def saturation_image(rgb: PixelArray) -> NDArray[np.uint8]:
    """Return 255 where a channel is at the end of the scale, else 0, (rows, columns).

    A 16-bit image counts as saturated from the last 8-bit step on, because cameras of 10 or 12 bit
    fill 16 bits by shifting.
    """
    top = end_of_scale(rgb)
    limit = 254 if top == 255 else 0xFEFF
    return (brightest_channel(rgb) > limit).view(np.uint8) * np.uint8(255)


def measure_exposure(rgb: PixelArray, *, dark: bool = True) -> Finding:
    """Judge the exposure of an image. The value is the share of saturated pixels in percent.

    Parameters
    ----------
    rgb : (rows, columns, 3) uint8 or uint16
        The whole image.
    dark : bool, optional
        Whether an image can be too dark: one that is dark by design is not.
    """
    saturation = saturation_image(rgb)
    fraction = cv2.countNonZero(saturation) / saturation.size
    brightest = _level_of_brightest(rgb)
    verdict = Verdict.PASS
    if fraction > SATURATED_WARN:
        verdict = Verdict.FAIL if fraction > SATURATED_FAIL else Verdict.WARN
        percent = _percent(100.0 * fraction)
        text = f"Too bright: {percent} % of the pixels are saturated. Shorten the exposure."
    elif dark and brightest < DARK_SHARE_OF_SCALE:
        verdict = Verdict.FAIL if brightest < 0.25 * DARK_SHARE_OF_SCALE else Verdict.WARN
        text = f"Too dark: maximum {_percent(100.0 * brightest)} % of the scale. "
        text += "Lengthen the exposure."
    elif brightest >= 1.0:
        text = "Good exposure, except for saturated bright spots."
    else:
        percent = _percent(100.0 * brightest)
        text = f"Good exposure: the brightest areas reach {percent} % of the scale."
    return Finding("saturated", text, 100.0 * fraction, "%", verdict=verdict)


def _level_of_brightest(rgb: PixelArray) -> float:
    """Return the share of the scale that the brightest pixels reach, except for a few."""
    levels = eight_bits(brightest_channel(rgb)).ravel()
    counts = np.cumsum(np.bincount(levels, minlength=256)[::-1])
    return float(255 - int(np.searchsorted(counts, BRIGHTEST_PIXELS))) / 255.0


def _percent(value: float) -> str:
    return f"{value:.0f}" if value >= 2.0 else f"{value:.1g}"


def measure_focus(rgb: PixelArray) -> float:
    """Return the sharpness of an image: squared steps over two pixels over squared brightness.

    Brenner's gradient, along rows and columns. Dividing by the brightness makes it independent of
    the exposure, so that only the focus changes it. Values of different scenes cannot be compared.

    Parameters
    ----------
    rgb : (rows, columns, 3) uint8 or uint16
        The whole image; a subsample has no fine detail.
    """
    grey = cv2.cvtColor(rgb, cv2.COLOR_RGB2GRAY)
    energy = cv2.norm(grey, cv2.NORM_L2SQR)
    if energy == 0.0 or min(grey.shape) < 3:
        return 0.0
    steps = cv2.norm(grey[2:], grey[:-2], cv2.NORM_L2SQR)
    steps += cv2.norm(grey[:, 2:], grey[:, :-2], cv2.NORM_L2SQR)
    return float(steps / energy)


class BestFocus:
    """Remembers the best sharpness, so that a user who turns the lens finds the way back to it.

    The memory loses half of its lead every :data:`BEST_HALF_LIFE_S`, so that another scene, which
    has another sharpness, gets its own best value.
    """

    def __init__(self) -> None:
        self.best = 0.0
        self._seen_s: float | None = None

    def update(self, focus: float, time_s: float) -> float:
        """Add a sharpness measured at `time_s`, and return it as a share of the best, 0..1."""
        if self._seen_s is not None:
            fade = 0.5 ** (max(time_s - self._seen_s, 0.0) / BEST_HALF_LIFE_S)
            self.best = focus + (self.best - focus) * fade
        self.best = max(self.best, focus)
        self._seen_s = time_s
        return focus / self.best if self.best > 0.0 else 0.0


def channel_histograms(rgb: PixelArray) -> NDArray[np.int64]:
    """Count pixels by brightness, separately for each channel.

    Parameters
    ----------
    rgb : (rows, columns, 3) uint8 or uint16
        The image, or a regular subset of its pixels.

    Returns
    -------
    (3, 64) int64
        Counts; the last bin is the end of the scale.
    """
    levels = rgb >> (8 * rgb.dtype.itemsize - 6)
    return np.stack([np.bincount(levels[..., k].ravel(), minlength=64) for k in range(3)])


def pixel_text(rgb: PixelArray, u: float, v: float) -> str:
    """Return the values of the pixel at (u, v) as text, empty outside the image."""
    rows, columns = rgb.shape[:2]
    if not (-0.5 <= u < columns - 0.5 and -0.5 <= v < rows - 0.5):
        return ""
    column, row = math.floor(u + 0.5), math.floor(v + 0.5)
    top = end_of_scale(rgb)
    values = (
        f"{name} {int(value)} ({100.0 * int(value) / top:.0f} %)"
        for name, value in zip(("R", "G", "B"), rgb[row, column], strict=True)
    )
    return f"u {column}, v {row}:  " + "   ".join(values)


STRIPE_PX = 6
# No LED of the sensor is magenta, and no membrane looks like it.
STRIPE_RGB = (255, 0, 255)


def eight_bits(rgb: PixelArray) -> NDArray[np.uint8]:
    """Return an image with 8 bits per channel, for the screen."""
    if rgb.dtype == np.uint8:
        return np.asarray(rgb, np.uint8)
    return (rgb >> 8).astype(np.uint8)


def with_zebra(rgb: PixelArray, phase: int = 0) -> NDArray[np.uint8]:
    """Return an image for the screen, striped where a channel is saturated.

    Parameters
    ----------
    rgb : (rows, columns, 3) uint8 or uint16
        Not changed.
    phase : int, optional
        Moves the stripes, one pixel a count.
    """
    rgb_8bit = eight_bits(rgb)
    saturation = saturation_image(rgb)
    if cv2.countNonZero(saturation) == 0:
        return rgb_8bit
    rows, columns = saturation.shape
    start = phase % (2 * STRIPE_PX)
    stripes = cv2.bitwise_and(saturation, _stripes(rows, columns)[start : start + rows])
    return np.asarray(cv2.copyTo(_colour(rows, columns), stripes, rgb_8bit.copy()), np.uint8)


@lru_cache(maxsize=2)
def _stripes(rows: int, columns: int) -> NDArray[np.uint8]:
    diagonal = np.arange(rows + 2 * STRIPE_PX)[:, None] + np.arange(columns)
    return np.where(diagonal // STRIPE_PX % 2, 255, 0).astype(np.uint8)


@lru_cache(maxsize=2)
def _colour(rows: int, columns: int) -> NDArray[np.uint8]:
    return np.full((rows, columns, 3), STRIPE_RGB, np.uint8)
