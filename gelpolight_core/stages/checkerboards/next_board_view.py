"""Suggested pose of the next checkerboard view for a lens calibration."""

from __future__ import annotations

import math
from collections.abc import Sequence

import cv2
import numpy as np

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.session.board import BoardSpec

from .checkerboard import BoardView
from .lens_quality import coverage_counts

ImageNinth = tuple[int, int]

ORDER: tuple[ImageNinth, ...] = (
    (0, 0), (0, 2), (2, 2), (2, 0), (0, 1), (1, 2), (2, 1), (1, 0), (1, 1),
)  # fmt: skip
"""(row, column) of the ninths of the image, the outer ones first."""
TILT_DEG = 25.0


def uncovered_ninth(views: Sequence[BoardView]) -> ImageNinth | None:
    """Return (row, column) of a ninth of the image without any corner, outer ninths first."""
    if not views:
        return ORDER[0]
    counts = coverage_counts(views, views[0].image_size)
    rows = [part.sum(axis=0) for part in np.array_split(counts, 3, axis=0)]
    ninths = np.array([[p.sum() for p in np.array_split(row, 3)] for row in rows])
    return next((ninth for ninth in ORDER if ninths[ninth] == 0), None)


def next_view(
    board: BoardSpec, size: tuple[int, int], earlier: Sequence[BoardView]
) -> Float64Array:
    """Return the outermost inner corners (4, 2) of a board in the suggested pose, in pixels.

    Each view has another tilt direction; it is placed where no view has corners yet.

    Parameters
    ----------
    board : BoardSpec
        The board.
    size : (width, height)
        Size of the image in pixels.
    earlier : sequence of BoardView
        Views captured before.
    """
    width, height = size
    across, down = (count - 1 for count in board.inner_corners)
    x, y = 0.5 * across, 0.5 * down
    corners = np.array([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]])
    # The golden angle: any number of successive directions is spread evenly.
    turn = math.radians(137.5 * len(earlier))
    axis = np.array([math.cos(turn), math.sin(turn), 0.0])
    rotation = cv2.Rodrigues(math.radians(TILT_DEG) * axis)[0]
    tilted: Float64Array = corners @ np.asarray(rotation, np.float64).T
    focal = float(width)
    tilted[:, 2] += focal * across / (0.45 * width)
    quad = focal * tilted[:, :2] / tilted[:, 2:]
    row, column = uncovered_ninth(earlier) or ORDER[len(earlier) % len(ORDER)]
    quad = quad + np.array([(column + 0.5) * width / 3.0, (row + 0.5) * height / 3.0])
    # Shifted into the image.
    margin, last = 0.02 * width, np.array(size) - 1.0
    low = np.maximum(margin - quad.min(axis=0), 0.0)
    high = np.minimum(last - margin - quad.max(axis=0), 0.0)
    return np.asarray(quad + low + high, np.float64)
