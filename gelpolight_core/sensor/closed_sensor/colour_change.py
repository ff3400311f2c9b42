"""Change of the membrane's colour relative to the untouched membrane.

Both images are smoothed over 2 nodes first: the texture of a gel moves with it and would look like
slope (1.3 degrees on a GelSight Mini).
"""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import BoolArray, Float32Array
from gelpolight_core.base.membrane_masks import LEAST_LIGHT, SATURATED
from gelpolight_core.stages.balls.markers import Markers, find_markers

SMOOTHING_NODES = 2.0
OFFSET = 0.02
"""Added to the background in the divisor, so that noise of dark areas is not amplified."""
LARGEST_CHANGE = 4.0


@dataclass(frozen=True, slots=True)
class ReferenceImage:
    """The untouched membrane.

    Attributes
    ----------
    background : (rows, columns, 3) float32
        Linear light, not smoothed.
    smooth : (rows, columns, 3) float32
        The same, smoothed; markers are filled from around them.
    markers : Markers
        Printed on the membrane; falsy where there are none.
    known : (rows, columns) bool
        Where there is light.
    plain : (rows, columns) bool
        The same without markers: what `smooth` was made from.
    """

    background: Float32Array
    smooth: Float32Array
    markers: Markers
    known: BoolArray
    plain: BoolArray


@dataclass(frozen=True, slots=True)
class ColourChange:
    """An image compared with its reference.

    Attributes
    ----------
    change : (rows, columns, 3) float32
        Smoothed image minus smoothed background, divided by the background.
    usable : (rows, columns) bool
        Known, not saturated and no marker.
    saturated : (rows, columns) bool
        A channel is at its upper end.
    """

    change: Float32Array
    usable: BoolArray
    saturated: BoolArray


def make_reference_image(background: Float32Array) -> ReferenceImage:
    """Return the reference that a background (rows, columns, 3) gives."""
    markers = find_markers(background)
    lit_mask = np.asarray((background > LEAST_LIGHT).any(axis=2))
    plain_mask = np.asarray(lit_mask & ~markers.mask)
    return ReferenceImage(
        background, _smooth(background, plain_mask), markers, lit_mask, plain_mask
    )


def colour_change(
    image: Float32Array, base: ReferenceImage, gain: NDArray[np.float64] | None = None
) -> ColourChange:
    """Return how an image differs from the untouched membrane, but for the strength of its light.

    Parameters
    ----------
    image : (rows, columns, 3) float32
        Linear light on the working grid; what is not finite is left out.
    base : ReferenceImage
        The untouched membrane.
    gain : (3,), optional
        Brightness of the image over the background's where nothing touches; by default 1.
    """
    # Channel by channel: a reduction over an axis of three is ten times slower.
    red, green, blue = (image[..., k] for k in range(3))
    finite: BoolArray = np.asarray(np.isfinite(red + green + blue))
    saturated = np.asarray(np.maximum(np.maximum(red, green), blue) >= SATURATED)
    usable = finite & base.known & ~saturated
    if base.markers:
        usable &= ~base.markers.covered(np.where(finite[..., None], image, base.background))
    measured = _smooth(image, usable)
    # Both from the same nodes: gaps shift the position of an average.
    is_same = np.array_equal(usable, base.plain)
    expected = base.smooth if is_same else _smooth(base.background, usable)
    if gain is not None:
        measured = np.asarray(measured / gain.astype(np.float32), np.float32)
    change = (measured - expected) / (expected + np.float32(OFFSET))
    np.clip(change, -LARGEST_CHANGE, LARGEST_CHANGE, out=change)
    return ColourChange(change, usable, saturated)


def _smooth(rgb: Float32Array, usable: BoolArray) -> Float32Array:
    """Smooth an image, with the reliable nodes only."""
    if usable.all():
        return np.asarray(cv2.GaussianBlur(rgb, (0, 0), SMOOTHING_NODES), np.float32)
    weight = cv2.GaussianBlur(usable.astype(np.float32), (0, 0), SMOOTHING_NODES)
    masked = np.where(usable[..., None], rgb, np.float32(0.0))
    total = cv2.GaussianBlur(masked, (0, 0), SMOOTHING_NODES)
    average = total / np.maximum(weight, 1e-3)[..., None]
    return np.asarray(average, np.float32)
