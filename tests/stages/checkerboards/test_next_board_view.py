"""Suggestions for the next lens view and the next ball press: who follows them gets enough."""

import cv2
import numpy as np

from gelpolight_core.session.board import BoardSpec
from gelpolight_core.stages.checkerboards.board_grid import foreshortening_tilt_deg
from gelpolight_core.stages.checkerboards.checkerboard import BoardView
from gelpolight_core.stages.checkerboards.lens_quality import coverage_counts
from gelpolight_core.stages.checkerboards.next_board_view import (
    TILT_DEG,
    next_view,
    uncovered_ninth,
)

BOARD, SIZE = BoardSpec((9, 6), 3.0), (1280, 960)
OUTER_MM = np.float32([[0, 0], [24, 0], [24, 15], [0, 15]])


def held(quad: np.ndarray) -> BoardView:
    """Return the view of a board whose outermost corners are at these pixels."""
    matrix = cv2.getPerspectiveTransform(OUTER_MM, quad.astype(np.float32))
    flat = np.float32(BOARD.points_mm[:, :2]).reshape(-1, 1, 2)
    flat -= flat.min(axis=0)
    corners = cv2.perspectiveTransform(flat, matrix).reshape(-1, 2).astype(np.float64)
    tilt_deg = foreshortening_tilt_deg(matrix, np.array([12.0, 7.5]))
    return BoardView("", BOARD, SIZE, corners, 0, 0, 40.0, 2.0, 0.5, 0.0, tilt_deg)


def test_twelve_suggested_views_are_whole_tilted_and_cover_the_image():
    views: list[BoardView] = []
    for _ in range(12):
        quad = next_view(BOARD, SIZE, views)
        assert (quad >= 0.0).all()
        assert (quad < SIZE).all()
        views.append(held(quad))
        assert abs(views[-1].tilt_deg - TILT_DEG) < 12.0
    assert uncovered_ninth(views) is None
    assert (coverage_counts(views, SIZE) > 0).mean() > 0.9
