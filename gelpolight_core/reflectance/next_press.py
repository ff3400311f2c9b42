"""Suggested position of the next ball press."""

from __future__ import annotations

from collections.abc import Sequence

import cv2
import numpy as np

from gelpolight_core.optics.resampling import ResamplingTable

Point = tuple[float, float]

COARSER = 8


def next_press_mm(
    table: ResamplingTable, radius_mm: float, earlier_mm: Sequence[Point]
) -> Point | None:
    """Return the position (x, y) in the working area that is farthest from all earlier presses.

    The first press is in the middle. It is always far enough from the border for the contact of the
    ball. None if the ball is too large for the field.
    """
    pitch_mm = COARSER * table.grid.pitch_mm
    valid = np.pad(table.valid[::COARSER, ::COARSER].astype(np.uint8), 1)
    inside_mm = pitch_mm * cv2.distanceTransform(valid, cv2.DIST_L2, 5)[1:-1, 1:-1]
    points = table.grid.points_mm()[::COARSER, ::COARSER]
    # A ball pressed in by half its radius has a contact of 0.87 of its radius.
    fits = inside_mm > 0.87 * radius_mm
    if not fits.any():
        return None
    distance_mm = inside_mm.astype(np.float64)
    if earlier_mm:
        offset_mm = points[:, :, None] - np.array(earlier_mm, np.float64)
        distance_mm = np.linalg.norm(offset_mm, axis=-1).min(axis=-1)
    best = np.unravel_index(np.argmax(np.where(fits, distance_mm, -1.0)), fits.shape)
    x_mm, y_mm = points[best]
    return float(x_mm), float(y_mm)
