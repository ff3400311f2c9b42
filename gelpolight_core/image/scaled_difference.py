"""Noise-scaled difference between a press and the image without contact.

A difference is significant only if it exceeds the noise and the change of light between any two
images of the same membrane. Both are therefore measured on the images themselves.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from gelpolight_core.base.arrays import BoolArray, Float32Array
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.membrane_masks import SATURATED
from gelpolight_core.base.robust import tukey_weights

# Consecutive images differ by about this share of their brightness (flicker of the light, settling
# of the membrane). Smaller differences are not an indentation, even without noise.
REPEATABILITY = 0.01
# The floor of noise: two images, each rounded by 1 / sqrt(12) of an 8-bit step.
ROUNDING = float(np.sqrt(2.0 / 12.0) / 255.0)
BACKGROUND = "background"
"""Name of the image without contact in messages."""
# Below this brightness a ratio of two images is mostly rounding.
DARK = 4.0 / 255.0
# Above a quarter, the exposure or a light was changed; warming changes it less.
LARGEST_GAIN_CHANGE = 0.25


@dataclass(frozen=True, slots=True)
class ScaledDifference:
    """Difference of two images, in units of the usual difference without a press.

    Attributes
    ----------
    difference : (rows, columns, 3) float32
        Press minus gain times background, 0 outside the working area.
    scaled : (small rows, small columns) float32
        Root of the summed squares of the smoothed difference over its noise, on a grid `factor`
        times coarser; about 1.7 where nothing changed.
    valid_small : (small rows, small columns) bool
        The working area on that grid.
    factor : int
        Pixels of the image per pixel of `scaled`, along an axis.
    gain : tuple of 3 floats
        Brightness of the press over that of the background where nothing touches, per channel.
    noise : tuple of 3 floats
        Standard deviation of the difference from pixel to pixel, per channel.
    relative : (small rows, small columns, 3) float32
        Logarithm of the smoothed press over gain times background; dark pixels count less.
    relative_noise : float
        Standard deviation of `relative` where nothing changed, mean over channels.
    """

    difference: Float32Array
    scaled: Float32Array
    valid_small: BoolArray
    factor: int
    gain: tuple[float, float, float]
    noise: tuple[float, float, float]
    relative: Float32Array
    relative_noise: float


def fill_holes_of_pair(
    press: Float32Array,
    background: Float32Array,
    valid: BoolArray | None,
    *,
    name: str,
) -> tuple[Float32Array, Float32Array, BoolArray]:
    """Return two images without holes with the area in which they can be compared.

    Parameters
    ----------
    press, background : (rows, columns, 3)
        Images; pixels that are not finite are left out of the area and set to 0.
    valid : (rows, columns) bool or None
        The working area; without it, the lit part of `background`.
    name : str
        Name of `press` in messages.

    Returns
    -------
    press, background : (rows, columns, 3) float32
        Finite images.
    area : (rows, columns) bool
        Where they count.

    Raises
    ------
    InputError
        If the shapes do not fit or an image is black or saturated.
    """
    _check_shapes(press, background, valid, name)
    # One sum is finite only where all six values are.
    with np.errstate(invalid="ignore", over="ignore"):
        finite = np.asarray(np.isfinite((press + background) @ np.ones(3, np.float32)))
    press, background = _without_holes(press, finite), _without_holes(background, finite)
    area = finite & (lit_area(background) if valid is None else valid)
    _check_exposure(background, area, BACKGROUND)
    _check_exposure(press, area, name)
    return press, background, area


def lit_area(background: Float32Array) -> BoolArray:
    """Return the lit part of an image without contact: its largest bright region, holes filled.

    Parameters
    ----------
    background : (rows, columns, 3)
        Image without contact, finite.

    Raises
    ------
    InputError
        If nothing is lit.
    """
    red, green, blue = cv2.split(background)
    light = cv2.GaussianBlur(cv2.max(cv2.max(red, green), blue), (0, 0), 2.0)
    # Below about a twentieth of the brightest, there is a dark edge, and ratios are meaningless.
    bright = light > max(0.05 * float(np.quantile(light[::3, ::3], 0.99)), 0.5 * DARK)
    regions, _ = cv2.findContours(bright.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    if not regions:
        raise InputError("the image is all black", BACKGROUND, Remedy.LIGHT_ON)
    filled = np.zeros(bright.shape, np.uint8)
    cv2.drawContours(filled, [max(regions, key=cv2.contourArea)], -1, 1, cv2.FILLED)
    return filled > 0


def _check_shapes(
    press: Float32Array, background: Float32Array, valid: BoolArray | None, name: str
) -> None:
    for image, what in ((press, name), (background, BACKGROUND)):
        if image.ndim != 3 or image.shape[2] != 3 or min(image.shape[:2]) < 32:
            shape = image.shape
            text = f"the array has shape {shape}, not of a colour image of 32x32 pixels or more"
            raise InputError(text, what, Remedy.CHOOSE_FILE)
    for other, what in ((background, BACKGROUND), (valid, "working area")):
        if other is not None and other.shape[:2] != press.shape[:2]:
            (rows, columns), (high, wide) = press.shape[:2], other.shape[:2]
            text = f"the image is {columns}x{rows} pixels and {what} is {wide}x{high}"
            raise InputError(text, name, Remedy.SAME_CAMERA)


def _check_exposure(image: Float32Array, area: BoolArray, name: str) -> None:
    step = max(1, min(image.shape[:2]) // 256)
    inside = image[::step, ::step][area[::step, ::step]]
    if len(inside) == 0:
        raise InputError("the working area is empty", name, Remedy.CHECK_AREA)
    brightest = inside.max(axis=1)
    if float(np.median(brightest)) < DARK:
        raise InputError("the image is all black", name, Remedy.LIGHT_ON)
    share = float(np.mean(brightest >= SATURATED))
    if share > 0.5:
        text = f"{100.0 * share:.0f} % of the image is saturated"
        raise InputError(text, name, Remedy.SHORTER_EXPOSURE)


def _without_holes(image: Float32Array, finite: BoolArray) -> Float32Array:
    if not finite.all():
        image = np.where(finite[..., None], image, np.float32(0.0))
    return image.astype(np.float32, copy=False)


def pixel_noise(difference: Float32Array, inside: BoolArray) -> Float32Array:
    """Return the standard deviation (3,) of a difference from pixel to pixel.

    The checkerboard difference of 2x2 pixels cancels every smooth shading; its median is
    robust against edges and specks.

    Parameters
    ----------
    difference : (rows, columns, 3)
        Any image.
    inside : (rows, columns) bool
        Which pixels count.
    """
    upper, lower = difference[:-1:2], difference[1::2]
    block = upper[:, :-1] - upper[:, 1:] - lower[:, :-1] + lower[:, 1:]
    both = inside[:-1:2] & inside[1::2]
    keep = both[:, :-1] & both[:, 1:]
    size = np.abs(take_subsample(block[keep])) / 2.0
    sigma = np.median(size, axis=0) / 0.6745 if len(size) else np.zeros(3)
    return np.asarray(np.maximum(sigma, ROUNDING), dtype=np.float32)


def match_gain(press: Float32Array, background: Float32Array, inside: BoolArray) -> Float32Array:
    """Return the brightness (3,) of `press` over `background` where nothing touches.

    A channel without light has gain 1.

    Parameters
    ----------
    press, background : (rows, columns, 3)
        Images of equal size, already averaged over a few pixels.
    inside : (rows, columns) bool
        Which pixels count.
    """
    gain = np.ones(3, dtype=np.float32)
    # Means over many pixels: a ratio of noisy pixels is biased and has a broad peak.
    before, after = (
        np.asarray(cv2.GaussianBlur(p, (0, 0), 3.0), np.float32) for p in (background, press)
    )
    for k in range(3):
        total = before[..., k] + after[..., k]
        # Chosen by the sum of both: a choice by the noise of one image would bias the ratio.
        lit = inside & (total > max(2.0 * DARK, 0.2 * float(total[inside].max(initial=0.0))))
        if np.count_nonzero(lit) >= 16:
            divisor = np.maximum(take_subsample(before[..., k][lit]), np.float32(0.25 * DARK))
            gain[k] = _densest(np.asarray(take_subsample(after[..., k][lit]) / divisor, np.float32))
    return gain


def _densest(ratio: Float32Array) -> float:
    """Return the mode of values: the shortest fifth, refined with Tukey's biweight.

    The untouched membrane is a narrow peak, for any share of the image; an indentation spreads over
    all brightnesses.
    """
    ordered = np.sort(ratio)
    count = max(2, len(ordered) // 5)
    start = int(np.argmin(ordered[count - 1 :] - ordered[: len(ordered) - count + 1]))
    fifth = ordered[start : start + count]
    centre = float(np.median(fifth))
    # A fifth about the middle of a normal distribution spans half a standard deviation.
    width = max(2.0 * float(fifth[-1] - fifth[0]), 0.1 * REPEATABILITY)
    for _ in range(10):
        residual = ratio - centre
        weight = tukey_weights(residual, 4.0 * width)
        centre += float((weight * residual).sum() / weight.sum())
    return centre


def scale_difference(
    press: Float32Array, background: Float32Array, valid: BoolArray
) -> ScaledDifference:
    """Return the difference of two images in units of its own noise.

    Parameters
    ----------
    press, background : (rows, columns, 3)
        Images of equal size, finite.
    valid : (rows, columns) bool
        The working area.
    """
    # A coarser grid of at most 640 pixels: averaging is the fastest method to make a faint
    # indentation exceed the noise.
    factor = max(1, -(-max(valid.shape) // 640))
    press_small, background_small = _shrink(press, factor), _shrink(background, factor)
    valid_small = _shrink(valid.astype(np.float32), factor) > 0.99
    gain = match_gain(press_small, background_small, valid_small)
    difference = np.where(valid[..., None], press - gain * background, np.float32(0.0))
    small = np.where(valid_small[..., None], press_small - gain * background_small, np.float32(0.0))
    # A median over 3x3 removes specks and hot pixels; a mean would spread them.
    smooth = np.asarray(cv2.GaussianBlur(cv2.medianBlur(small, 3), (0, 0), 1.0), np.float32)
    noise = _smooth_noise(smooth, valid_small)
    variance = noise**2 + (REPEATABILITY * background_small) ** 2
    scaled = np.sqrt((smooth**2 / variance).sum(axis=2)) * valid_small
    sigma = pixel_noise(difference, valid)
    relative = _relative_change(press_small, gain * background_small, valid_small)
    relative_noise = _smooth_noise(relative[::3], valid_small[::3])
    return ScaledDifference(
        difference.astype(np.float32, copy=False),
        scaled.astype(np.float32),
        valid_small,
        factor,
        (float(gain[0]), float(gain[1]), float(gain[2])),
        (float(sigma[0]), float(sigma[1]), float(sigma[2])),
        relative,
        float(np.sqrt(np.mean(relative_noise**2))),
    )


def _relative_change(
    press: Float32Array, background: Float32Array, valid: BoolArray
) -> Float32Array:
    """Return the smoothed logarithm of press over background, 0 outside the working area."""
    dim = np.float32(2.0 * DARK)
    ratio = (press + dim) / (background + dim)
    change = np.asarray(cv2.log(ratio), np.float32)
    change[~valid] = 0.0
    return np.asarray(cv2.GaussianBlur(change, (0, 0), 1.0), np.float32)


def mean_relative_change(
    change: ScaledDifference, background: Float32Array, where: BoolArray
) -> float:
    """Return the typical relative change of brightness in an area, 0 if it is dark.

    Parameters
    ----------
    change : ScaledDifference
        Difference of the two images.
    background : (rows, columns, 3)
        Image without contact.
    where : (rows, columns) bool
        Which pixels count.
    """
    step = change.factor
    light = background[::step, ::step].sum(axis=2)
    smoothed = cv2.GaussianBlur(change.difference, (0, 0), 2.0)[::step, ::step]
    keep = where[::step, ::step] & (light > 3.0 * DARK)
    if np.count_nonzero(keep) < 16:
        return 0.0
    return float(np.median(np.abs(smoothed[keep]).sum(axis=1) / light[keep]))


def check_gain(gain: tuple[float, float, float], name: str) -> None:
    """Refuse a press with other light than the background.

    Raises
    ------
    InputError
        If a channel's gain is beyond `LARGEST_GAIN_CHANGE`.
    """
    worst = max(gain, key=lambda g: abs(g - 1.0))
    if abs(worst - 1.0) > LARGEST_GAIN_CHANGE:
        text = f"a colour channel is {worst:.2f} times as bright as in the background"
        raise InputError(text, name, Remedy.SAME_LIGHT)


def take_subsample(values: Float32Array) -> Float32Array:
    """Return every n-th of `values` along the first axis, enough of them for a median."""
    # Medians of 60,000 pixels are accurate to about half a percent; more only take more time.
    return values[:: max(1, len(values) // 60_000)]


def _shrink(image: Float32Array, factor: int) -> Float32Array:
    """Return block means, without rows and columns that do not fill a block."""
    if factor == 1:
        return image
    rows, columns = image.shape[0] // factor, image.shape[1] // factor
    cropped = image[: rows * factor, : columns * factor]
    return np.asarray(cv2.resize(cropped, (columns, rows), interpolation=cv2.INTER_AREA))


def _smooth_noise(smooth: Float32Array, inside: BoolArray) -> Float32Array:
    """Return the remaining noise (3,) after smoothing.

    Second differences over a few pixels, so that noise which was already correlated (resampling,
    demosaicing) is seen in full; the lower quartile, so that an indentation over half of the
    image does not count as noise.
    """
    lag = 4
    if inside.shape[1] <= 2 * lag:
        return np.full(3, ROUNDING, dtype=np.float32)
    second = smooth[:, : -2 * lag] - 2.0 * smooth[:, lag:-lag] + smooth[:, 2 * lag :]
    keep = inside[:, : -2 * lag] & inside[:, lag:-lag] & inside[:, 2 * lag :]
    size = np.abs(take_subsample(second[keep])) / np.sqrt(6.0)
    quartile = np.quantile(size, 0.25, axis=0) / 0.3186 if len(size) else np.zeros(3)
    return np.asarray(np.maximum(quartile, 0.3 * ROUNDING), dtype=np.float32)
