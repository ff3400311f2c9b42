"""Raw (Bayer) images of a camera: each pixel has one colour, in a mosaic of 2 x 2 pixels."""

from __future__ import annotations

import cv2
import numpy as np

from gelpolight_core.base.arrays import Float32Array

WINDOW_PX = 16
"""The alternation is averaged over this width. What noise leaves of red minus blue there is a sixth
of the noise between two pixels: 4 / 16 of a pixel's against the root of 2."""
# Along an axis, each keeps one of two patterns, (-1)^n or a constant, and removes the other one.
_ALTERNATING = np.array([-0.25, 0.5, -0.25], np.float32)
_EVEN = np.array([0.25, 0.5, 0.25], np.float32)
# Differences between pixels of the same colour, with the variance of one pixel.
_SAME_COLOUR = np.array([-1.0, 0.0, 2.0, 0.0, -1.0], np.float32) / np.sqrt(np.float32(6.0))


def is_mosaic(grey: Float32Array) -> bool:
    """Return whether a grey image is a mosaic: red and blue on a diagonal, green on the other.

    Columns then alternate by a quarter of red minus blue, and rows by as much: their product has
    one sign in the whole image. Stripes alternate in one direction only, and the product has
    any sign in texture and noise. Red and blue must differ by more than the two greens, and by
    more than noise and texture make two pixels of the same colour differ.

    Parameters
    ----------
    grey : (height, width) float32
        Light, on any scale.
    """
    across = _alternation(grey)
    down = _alternation(np.ascontiguousarray(grey.T)).T
    noise = cv2.sepFilter2D(grey, -1, _SAME_COLOUR, _SAME_COLOUR)
    # All three are squares of a quarter of a difference.
    colours = float(abs(np.mean(across * down)))
    greens = float(np.mean(across**2 + down**2)) / 2.0 - colours
    two_pixels = 2.0 * float(np.mean(noise**2)) / 4.0**2
    return min(grey.shape) >= WINDOW_PX and colours > greens + two_pixels


def _alternation(grey: Float32Array) -> Float32Array:
    """Return the difference of even columns from odd ones, halved, around each pixel."""
    alternating = cv2.sepFilter2D(grey, -1, _ALTERNATING, _EVEN)
    alternating[:, 1::2] = -alternating[:, 1::2]
    return np.asarray(cv2.blur(alternating, (WINDOW_PX, WINDOW_PX)), np.float32)
