"""Frames as eight bits for the screen, with stripes on saturated pixels."""

from __future__ import annotations

from functools import lru_cache

import cv2
import numpy as np
from numpy.typing import NDArray

from app.live.image_checks import Rgb, saturated

STRIPE_PX = 6
# No LED of the sensor is magenta, and no membrane looks like it.
STRIPE_RGB = (255, 0, 255)


def eight_bits(rgb: Rgb) -> NDArray[np.uint8]:
    """Return an image as shown on the screen; of 16 bits the high byte."""
    if rgb.dtype == np.uint8:
        return np.asarray(rgb, np.uint8)
    return (rgb >> 8).astype(np.uint8)


def with_zebra(rgb: Rgb, phase: int = 0) -> NDArray[np.uint8]:
    """Return an image for the screen, striped where a channel is saturated.

    Parameters
    ----------
    rgb : (rows, columns, 3) uint8 or uint16
        Not changed.
    phase : int, optional
        Moves the stripes, one pixel a count.
    """
    shown = eight_bits(rgb)
    full = saturated(rgb)
    if cv2.countNonZero(full) == 0:
        return shown
    rows, columns = full.shape
    start = phase % (2 * STRIPE_PX)
    stripes = cv2.bitwise_and(full, _stripes(rows, columns)[start : start + rows])
    return np.asarray(cv2.copyTo(_colour(rows, columns), stripes, shown.copy()), np.uint8)


@lru_cache(maxsize=2)
def _stripes(rows: int, columns: int) -> NDArray[np.uint8]:
    along = np.arange(rows + 2 * STRIPE_PX)[:, None] + np.arange(columns)
    return np.where(along // STRIPE_PX % 2, 255, 0).astype(np.uint8)


@lru_cache(maxsize=2)
def _colour(rows: int, columns: int) -> NDArray[np.uint8]:
    return np.full((rows, columns, 3), STRIPE_RGB, np.uint8)
