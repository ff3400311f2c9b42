"""Change of the membrane's colour relative to the untouched membrane.

Both images are smoothed first: the texture of a gel moves with it and would look like slope (1.3
degrees on a GelSight Mini). Colours are not linear in the slope, so too much of it changes the
slopes beside steep walls (20 to 40 % with 2 nodes). How much a gel needs follows from the presses.
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
"""Standard deviation of the smoothing until the presses tell how much the gel needs."""
SMOOTHINGS = (0.7, 1.0, 1.4, SMOOTHING_NODES, 2.8)
"""What is tried, a factor of root 2 apart. Chosen: with less than 0.7 noise grows, and more than
2.8 flattens the contacts of small balls."""
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
    smoothing_nodes : float
        Standard deviation of the smoothing.
    """

    background: Float32Array
    smooth: Float32Array
    markers: Markers
    known: BoolArray
    plain: BoolArray
    smoothing_nodes: float


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


def make_reference_image(
    background: Float32Array, smoothing_nodes: float = SMOOTHING_NODES
) -> ReferenceImage:
    """Return the reference that a background (rows, columns, 3) gives."""
    markers = find_markers(background)
    lit_mask = np.asarray((background > LEAST_LIGHT).any(axis=2))
    plain_mask = np.asarray(lit_mask & ~markers.mask)
    smooth = _smooth(background, plain_mask, smoothing_nodes)
    return ReferenceImage(background, smooth, markers, lit_mask, plain_mask, smoothing_nodes)


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
    measured = _smooth(image, usable, base.smoothing_nodes)
    # Both from the same nodes: gaps shift the position of an average.
    expected = base.smooth
    if not np.array_equal(usable, base.plain):
        expected = _smooth(base.background, usable, base.smoothing_nodes)
    if gain is not None:
        measured = np.asarray(measured / gain.astype(np.float32), np.float32)
    change = (measured - expected) / (expected + np.float32(OFFSET))
    np.clip(change, -LARGEST_CHANGE, LARGEST_CHANGE, out=change)
    return ColourChange(change, usable, saturated)


def _smooth(rgb: Float32Array, usable: BoolArray, sigma: float) -> Float32Array:
    """Smooth an image, with the reliable nodes only."""
    if usable.all():
        return np.asarray(cv2.GaussianBlur(rgb, (0, 0), sigma), np.float32)
    weight = cv2.GaussianBlur(usable.astype(np.float32), (0, 0), sigma)
    masked = np.where(usable[..., None], rgb, np.float32(0.0))
    total = cv2.GaussianBlur(masked, (0, 0), sigma)
    average = total / np.maximum(weight, 1e-3)[..., None]
    return np.asarray(average, np.float32)
