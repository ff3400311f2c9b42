"""Check a raw image of the bare membrane: lit, not saturated, and touched by nothing.

The wizard's live hint and the background stage use the same function. It works on the raw image at
a quarter of its size.
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from gelpolight_core.base.arrays import BoolArray, Float32Array, FrameArray
from gelpolight_core.base.channels import CHANNEL_KEYS
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import Finding, QualityTable, judge
from gelpolight_core.geometry.resampling import ResamplingTable, working_area

from .whiteboard_stage import LEAST_LIGHT

SHRINK = 4
# Half of the shading change at the edge of a shallow contact, and twice the noise.
CHANGE = 0.10
# Below eight steps of 8 bit, a ratio is mostly rounding error.
LEAST_RATIO_LIGHT = 8.0 / 255.0
END_OF_SCALE = 254.5 / 255.0


@dataclass(frozen=True, slots=True)
class BareMembraneCheck:
    """Result of the check of a bare membrane image.

    Attributes
    ----------
    pressed : (rows / 4, columns / 4) bool
        Areas that something seems to touch, if it is not the coating that differs there; all False
        without a whiteboard image for comparison.
    quality : QualityTable
        Light, saturation and touched area.
    """

    pressed: BoolArray
    quality: QualityTable


def check_bare_membrane(
    image: FrameArray, *, table: ResamplingTable | None = None, whiteboard: FrameArray | None = None
) -> BareMembraneCheck:
    """Judge an image of the bare membrane.

    Parameters
    ----------
    image : (rows, columns, 3) uint8, uint16 or float32
        As encoded by the camera; floats 0..1.
    table : ResamplingTable, optional
        Defines the working area; without it the whole image counts.
    whiteboard : (rows, columns, 3), optional
        Image of the whiteboard stage; contacts are found by comparison with it.

    Raises
    ------
    InputError
        If the image is that of the whiteboard, or the working area is not in it.
    """
    small = quarter_size(image)
    area = quarter_size_area(image.shape[:2], table)
    pressed = np.zeros(area.shape, np.bool_)
    if whiteboard is not None and whiteboard.shape == image.shape:
        white = quarter_size(whiteboard)
        if is_same(small, white, area):
            text = "The image shows the same as the whiteboard image"
            raise InputError(text, "background", Remedy.WITH_MEMBRANE)
        pressed = _find_pressed(small, white, area)
    full, touched = saturated_percent(image, area), 100.0 * _share(pressed, area)
    shorter = "Shorten the exposure so that nothing is saturated"
    clean = (
        "Remove anything that touches the membrane, and wipe it clean; if its coating is worn or"
        " printed there, continue: the ball presses show it"
    )
    label = "Area that seems to be pressed"
    figures = (
        brightness_figure(small, area),
        judge("saturated", "Saturated share", full, "%", warn=1.0, fail=20.0, remedy=shorter),
        judge("pressed", label, touched, "%", warn=0.0, remedy=clean),
    )
    return BareMembraneCheck(pressed, QualityTable(figures))


def quarter_size(image: FrameArray) -> Float32Array:
    """Return an image at a quarter of its size, float32 0..1."""
    rows, columns = image.shape[:2]
    size = (columns // SHRINK, rows // SHRINK)
    small = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.float32)
    return small if image.dtype.kind == "f" else small / np.float32(np.iinfo(image.dtype).max)


def quarter_size_area(shape: tuple[int, ...], table: ResamplingTable | None) -> BoolArray:
    """Return the working area at a quarter of the image size, by default the whole image.

    Raises
    ------
    InputError
        If the working area is not in the image.
    """
    size = (shape[1] // SHRINK, shape[0] // SHRINK)
    if table is None:
        return np.ones(size[::-1], np.bool_)
    area = working_area(table, (shape[0], shape[1])).astype(np.float32)
    whole = np.asarray(cv2.resize(area, size, interpolation=cv2.INTER_AREA)) > 0.99
    if not whole.any():
        raise InputError("The working area is not in the image", "background", Remedy.CHECK_LENGTHS)
    return whole


def brightness_figure(small: Float32Array, area: BoolArray) -> Finding:
    """Judge the brightness of the dimmest channel within the area."""
    brightest = 100.0 * np.percentile(small[area], 99.0, axis=0)
    dimmest = int(np.argmin(brightest))
    return judge(
        "brightest_percent",
        f"Brightness of the darkest colour, {CHANNEL_KEYS[dimmest]}",
        float(brightest[dimmest]),
        "%",
        warn=25.0,
        fail=200.0 * LEAST_LIGHT,
        higher_is_better=True,
        remedy=Remedy.LIGHT_ON,
    )


def saturated_percent(image: FrameArray, area: BoolArray) -> float:
    """Return the share of the area (at a quarter of the size) with a saturated channel."""
    top = 1.0 if image.dtype.kind == "f" else float(np.iinfo(image.dtype).max)
    full = (image.max(axis=2) >= END_OF_SCALE * top).astype(np.float32)
    rows, columns = area.shape
    # The share of a block's pixels, so that none is lost at a quarter of the size.
    part = np.asarray(cv2.resize(full, (columns, rows), interpolation=cv2.INTER_AREA))
    return 100.0 * float(part[area].mean())


def local_change(values: Float32Array, area: BoolArray, sigma_px: float) -> Float32Array:
    """Return |value / smooth value - 1|, the largest of the channels.

    The smooth value is a mean within the area, corrected once by the mean of what is left: the
    bright spots of a glossy membrane, and the area's boundary, are smooth.
    """
    weight = area.astype(np.float32)[..., None]
    weight_blurred = np.maximum(np.asarray(cv2.GaussianBlur(weight, (0, 0), sigma_px)), 1e-3)[
        ..., None
    ]
    smooth = np.zeros_like(values)
    for _ in range(2):
        residual = cv2.GaussianBlur((values - smooth) * weight, (0, 0), sigma_px)
        smooth += np.asarray(residual, np.float32) / weight_blurred
    change = np.abs(values / np.maximum(smooth, 1e-3) - 1.0)
    return np.asarray(change.max(axis=2), np.float32)


def is_same(small: Float32Array, other: Float32Array, area: BoolArray) -> bool:
    """Return whether two reduced images show the same scene."""
    lit = area & (np.minimum(small, other).min(axis=2) > LEAST_RATIO_LIGHT)
    if not lit.any():
        return False
    deviation = np.abs(small[lit] / other[lit] - 1.0)
    # Two images of the same scene differ by at most 2 %, due to noise and flicker.
    return float(np.median(deviation, axis=0).max()) < 0.02


def _share(mask: BoolArray, area: BoolArray) -> float:
    return int(np.count_nonzero(mask & area)) / max(int(np.count_nonzero(area)), 1)


def _find_pressed(small: Float32Array, whiteboard: Float32Array, area: BoolArray) -> BoolArray:
    """Return where the membrane's reflectance changes as it does around a contact.

    Division by the whiteboard removes the unevenness of the light; a median removes specks.
    """
    lit = area & (np.minimum(small, whiteboard).min(axis=2) > LEAST_RATIO_LIGHT)
    ratio = small / np.maximum(whiteboard, LEAST_RATIO_LIGHT)
    smooth = np.asarray(cv2.medianBlur(ratio, 5), np.float32)
    # A contact covers a few hundredths of the image width, and its shading is wider than specks.
    changed = lit & (local_change(smooth, lit, 0.04 * small.shape[1]) > CHANGE)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(changed.astype(np.uint8))
    # A larger area is no speck of the membrane.
    min_area = (0.015 * small.shape[1]) ** 2
    large = [n for n in range(1, count) if stats[n, cv2.CC_STAT_AREA] >= min_area]
    return np.isin(labels, large)
