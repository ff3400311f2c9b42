"""Rough corners of a checkerboard, from OpenCV's detectors.

They say where a board may be, to a pixel or so; nothing that they say is taken on trust.
"""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

# A larger copy only costs time.
LARGEST_SEARCH_PX = 1300


def find_rough_corners(grey: NDArray[np.float32], size: tuple[int, int]) -> Array | None:
    """Ask OpenCV's contour detector for the corners: a few milliseconds.

    Parameters
    ----------
    grey : (height, width) float32
        The picture.
    size : (columns, rows)
        Of the inner corners.

    Returns
    -------
    (rows, columns, 2) or None
        Rough (u, v), rows following columns clockwise; None where no such board was found.
    """
    small, scale = _for_detector(grey, longest_px=640)
    flags = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
    ok, corners = cv2.findChessboardCorners(small, size, flags=flags)
    if not ok:
        return None
    return _in_full_size(np.asarray(corners).reshape(size[1], size[0], 2), scale)


def search_rough_corners(
    grey: NDArray[np.float32], size: tuple[int, int], *, longest_px: int = LARGEST_SEARCH_PX
) -> Array | None:
    """Ask OpenCV's slow detector, which copes with more noise and blur and with uneven light.

    Parameters
    ----------
    grey : (height, width) float32
        The picture.
    size : (columns, rows)
        Of the inner corners.
    longest_px : int, optional
        Search in a copy of at most this size: smaller is quicker and misses smaller boards.

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


def search_any_size(grey: NDArray[np.float32]) -> Array | None:
    """Ask OpenCV for the corners of whatever board there is.

    Parameters
    ----------
    grey : (height, width) float32
        The picture.

    Returns
    -------
    (rows, columns, 2) or None
        As from :func:`find_rough_corners`, with as many rows and columns as there seem to be.
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
    grey: NDArray[np.float32], *, longest_px: int = LARGEST_SEARCH_PX
) -> tuple[NDArray[np.uint8], Array]:
    """Return an 8-bit copy of at most `longest_px`, and its scale."""
    low, high = np.percentile(grey[::4, ::4], [0.5, 99.5])
    stretched = np.clip((grey - low) * (255.0 / max(high - low, 1e-6)), 0.0, 255.0)
    shrink = max(1.0, max(grey.shape) / longest_px)
    width, height = (round(n / shrink) for n in (grey.shape[1], grey.shape[0]))
    small = cv2.resize(stretched, (width, height), interpolation=cv2.INTER_AREA)
    scale = np.array([grey.shape[1] / width, grey.shape[0] / height])
    return np.asarray(small, dtype=np.uint8), scale


def _in_full_size(corners: NDArray[Any], scale: Array) -> Array:
    """Undo the shrinking, and let rows follow columns clockwise, as on a board's printed side."""
    full = (corners.astype(np.float64) + 0.5) * scale - 0.5
    along = full[0, -1] - full[0, 0]
    down = full[-1, 0] - full[0, 0]
    left_handed = along[0] * down[1] - along[1] * down[0] < 0.0
    return np.ascontiguousarray(full[:, ::-1]) if left_handed else full
