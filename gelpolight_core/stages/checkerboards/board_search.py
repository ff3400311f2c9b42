"""Approximate corners of a checkerboard, from OpenCV's detectors.

They propose where a board may be, to about one pixel; every proposal is checked afterwards.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float32Array, Float64Array

# A larger copy only costs time.
LARGEST_SEARCH_PX = 1300


def find_rough_corners(grey: Float32Array, size: tuple[int, int]) -> Float64Array | None:
    """Find the corners with OpenCV's contour detector, in a few milliseconds.

    Parameters
    ----------
    grey : (height, width) float32
        The image.
    size : (columns, rows)
        Number of inner corners.

    Returns
    -------
    (rows, columns, 2) or None
        Approximate (u, v), rows following columns clockwise; None if no such board was found.
    """
    small, scale = _for_detector(grey, longest_px=640)
    flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
    ok, corners = cv2.findChessboardCorners(small, size, flags=flags)
    if not ok:
        return None
    return _in_full_size(np.asarray(corners).reshape(size[1], size[0], 2), scale)


def search_rough_corners(
    grey: Float32Array, size: tuple[int, int], *, longest_px: int = LARGEST_SEARCH_PX
) -> Float64Array | None:
    """Find the corners with OpenCV's slow detector, which tolerates noise, blur and uneven light.

    Parameters
    ----------
    grey : (height, width) float32
        The image.
    size : (columns, rows)
        Number of inner corners.
    longest_px : int, optional
        Search in a copy of at most this size: smaller is faster but misses smaller boards.

    Returns
    -------
    (rows, columns, 2) or None
        As from :func:`find_rough_corners`.
    """
    small, scale = _for_detector(grey, longest_px=longest_px)
    for flags in (cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE, 0):
        ok, corners = cv2.findChessboardCornersSB(small, size, flags=flags)
        if ok:
            return _in_full_size(np.asarray(corners).reshape(size[1], size[0], 2), scale)
    return None


def search_any_size(grey: Float32Array) -> Float64Array | None:
    """Find the corners of a board of unknown size with OpenCV.

    Parameters
    ----------
    grey : (height, width) float32
        The image.

    Returns
    -------
    (rows, columns, 2) or None
        As from :func:`find_rough_corners`, with the detected number of rows and columns.
    """
    small, scale = _for_detector(grey)
    for search in (0, cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_EXHAUSTIVE):
        ok, corners, marks = cv2.findChessboardCornersSBWithMeta(
            small, (3, 3), search | cv2.CALIB_CB_LARGER
        )
        if ok:
            rows, columns = np.asarray(marks).shape[:2]
            return _in_full_size(np.asarray(corners).reshape(rows, columns, 2), scale)
    return None


def _for_detector(
    grey: Float32Array, *, longest_px: int = LARGEST_SEARCH_PX
) -> tuple[NDArray[np.uint8], Float64Array]:
    """Return an 8-bit copy of at most `longest_px` with its scale."""
    low, high = np.percentile(grey[::4, ::4], [0.5, 99.5])
    stretched = np.clip((grey - low) * (255.0 / max(high - low, 1e-6)), 0.0, 255.0)
    shrink = max(1.0, max(grey.shape) / longest_px)
    width, height = (round(n / shrink) for n in (grey.shape[1], grey.shape[0]))
    small = cv2.resize(stretched, (width, height), interpolation=cv2.INTER_AREA)
    scale = np.array([grey.shape[1] / width, grey.shape[0] / height])
    return np.asarray(small, dtype=np.uint8), scale


def _in_full_size(corners: NDArray[Any], scale: Float64Array) -> Float64Array:
    """Scale back to full size, and order rows clockwise after columns, as on the printed side."""
    full = (corners.astype(np.float64) + 0.5) * scale - 0.5
    along = full[0, -1] - full[0, 0]
    down = full[-1, 0] - full[0, 0]
    left_handed = along[0] * down[1] - along[1] * down[0] < 0.0
    return np.ascontiguousarray(full[:, ::-1]) if left_handed else full
