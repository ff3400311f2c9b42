"""Check that an image of a checkerboard is bright and sharp enough to locate its corners."""

from __future__ import annotations

import math

import cv2
import numpy as np

from gelpolight_core.base.arrays import BoolArray, Float32Array, Float64Array
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.membrane_masks import SATURATED
from gelpolight_core.image.linear_image import LinearImage

# Ten steps of an 8-bit image: below this, rounding alone moves an edge by 1/20 pixel.
MIN_CONTRAST = 10.0 / 255.0
# 10 % to 90 % of an edge blurred by a Gaussian of sd 1.
EDGE_OF_SIGMA = 2.563


def check_exposure(grey: Float32Array, name: str) -> None:
    """Refuse an image without content.

    Parameters
    ----------
    grey : (height, width) float32
        The image, 0..1.
    name : str
        Name of the image.

    Raises
    ------
    InputError
        If the image contains invalid pixels, or is black, saturated or uniform.
    """
    finite = np.isfinite(grey)
    if not finite.all():
        count = int(np.count_nonzero(~finite))
        raise InputError(f"{count} pixels have no valid value", name, Remedy.CAPTURE_AGAIN)
    # One pixel in 200 at each end may be a glint or a hole.
    low, high = np.percentile(grey[::2, ::2], [0.5, 99.5])
    if high - low >= MIN_CONTRAST:
        return
    if low >= SATURATED - MIN_CONTRAST:
        raise InputError("The image is saturated", name, Remedy.SHORTER_EXPOSURE)
    if high < 3.0 * MIN_CONTRAST:
        raise InputError("The image is black", name, Remedy.LIGHT_ON)
    raise InputError("The image has the same brightness everywhere", name, Remedy.SHOW_BOARD)


def saturated_share(image: LinearImage, corners: Float64Array) -> float:
    """Return the saturated share of the lighter half of the board.

    Parameters
    ----------
    image : LinearImage
        In colour: one saturated channel is enough.
    corners : (rows, columns, 2)
        (u, v) of the board's corners.

    Returns
    -------
    float
        0..1.
    """
    outline = np.concatenate(
        [corners[0], corners[1:, -1], corners[-1, -2::-1], corners[-2:0:-1, 0]]
    )
    left, top = np.maximum(np.floor(outline.min(axis=0)).astype(int), 0)
    right, bottom = np.ceil(outline.max(axis=0)).astype(int)
    cut = image.rgb[top : bottom + 1, left : right + 1]
    mask = np.zeros(cut.shape[:2], dtype=np.uint8)
    cv2.fillPoly(mask, [np.round(outline - [left, top]).astype(np.int32)], (1.0,))
    full: BoolArray = np.asarray((cut >= SATURATED).any(axis=2))
    return min(1.0, 2.0 * float(np.mean(full[mask.astype(bool)])))


def edge_limit_px(width_px: int) -> float:
    """Return the largest edge width, 10 % to 90 %, at which an image counts as sharp.

    Parameters
    ----------
    width_px : int
        Width of the image.
    """
    # An edge wider than 1/200 of the image resolves fewer than 100 line pairs across it, too few
    # for a depth map. Three pixels are sharp enough for any fit, however small the image.
    return max(3.0, width_px / 200.0)


def sharpest_edge_px(grey: Float32Array) -> float:
    """Return the 10 % to 90 % width of the steepest edges of the image, scaled to full contrast.

    Parameters
    ----------
    grey : (height, width) float32
        The image.
    """
    smooth = cv2.GaussianBlur(grey, (0, 0), 1.0)
    low, high = np.percentile(smooth, [1.0, 99.0])
    steepest = float(np.percentile(np.hypot(*np.gradient(smooth)), 99.8))
    # A Gaussian edge of sd s and height H has a slope of at most H / (s sqrt(2 pi)); the one pixel
    # of smoothing is subtracted from s.
    sigma = (high - low) / (math.sqrt(2.0 * math.pi) * max(steepest, 1e-9))
    return float(EDGE_OF_SIGMA * math.sqrt(max(sigma**2 - 1.0, 0.0)))


def blur_error(edge_width_px: float, limit_px: float, name: str) -> InputError:
    """Return the error for a blurred image.

    Parameters
    ----------
    edge_width_px, limit_px : float
        Edge width from 10 % to 90 %, and its limit.
    name : str
        Name of the image.
    """
    text = (
        f"The image is blurred: edges are {edge_width_px:.1f} px wide, but at most "
        f"{limit_px:.1f} px is allowed"
    )
    return InputError(text, name, Remedy.FOCUS)
