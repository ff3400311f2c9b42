"""Find the checkerboard of a lens view in an image, and suggest which view to show next.

Pure functions from a frame (rows, columns, 3) uint8 or uint16 RGB and earlier results to a
:class:`~app.calibrate.detection.Detection`. They run in the processing thread. The stage itself
judges each captured image again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
from numpy.typing import NDArray

from app.calibrate.detection import Detection, as_image, or_refusal
from app.calibrate.lens.next_view import next_view, uncovered_ninth
from app.calibrate.marks import board_corners, board_outline
from app.live.image_checks import Rgb
from app.live.overlay import Line, Marker, Overlay
from gelpolight_core.errors import InputError
from gelpolight_core.image.linear import LinearImage
from gelpolight_core.optics.board_exposure import (
    blur_error,
    check_exposure,
    edge_limit_px,
    sharpest_edge_px,
)
from gelpolight_core.optics.board_search import find_rough_corners, search_rough_corners
from gelpolight_core.optics.checkerboard import BoardView, find_board
from gelpolight_core.optics.lens_quality import coverage_counts
from gelpolight_core.quality import Figure, judge
from gelpolight_core.session.board import BoardSpec
from gelpolight_core.translation import tr

Array = NDArray[np.float64]

# The slow search uses a small copy, so that a frame without a board stays quick. Below 400 pixels
# it begins to miss boards that the image border cuts off, and then takes longer.
GLANCE_PX = 480
# The lens stage recommends 15 to 40 degrees. Below 10 a board is foreshortened by less than 2 %:
# two such views show the distortion, more of them add little.
LEAST_TILT_DEG = 10.0
FLAT_VIEWS = 2
# A board that tilts by ten degrees to the other side moves its corners by this much, which is
# enough for a useful new view.
SAME_VIEW_OF_SQUARE = 0.2


def detect_board(
    rgb: Rgb, board: BoardSpec, *, earlier: Sequence[BoardView] = (), patient: bool = False
) -> Detection:
    """Find a lens view of the checkerboard, and suggest which view to show next.

    Parameters
    ----------
    rgb : (rows, columns, 3)
        The frame.
    board : BoardSpec
        The expected board.
    earlier : sequence of BoardView
        Views captured before.
    patient : bool, optional
        Search as long as the stage itself, up to a second; for still images.
    """
    faint = Overlay(lines=tuple(board_outline(view, "info") for view in earlier))
    wanted = Overlay() if patient else _suggested(rgb, board, earlier)
    searching = Overlay(lines=(*faint.lines, *wanted.lines), markers=wanted.markers)

    def detect() -> Detection:
        image = as_image(rgb)
        view = find_board(image, board, rough=None if patient else glance(image, board))
        marks = Overlay(
            markers=board_corners(view), lines=(*faint.lines, board_outline(view, "good"))
        )
        text, ready = _next_view(view, earlier)
        if not ready:  # shows where to move the board
            marks = replace(
                marks,
                lines=(*marks.lines, *wanted.lines),
                markers=(*marks.markers, *wanted.markers),
            )
        return Detection(marks, text, ready, _view_figures(view, earlier), view)

    return or_refusal(detect, marks=searching)


def _suggested(rgb: Rgb, board: BoardSpec, earlier: Sequence[BoardView]) -> Overlay:
    """Return the outline of the suggested next view."""
    quad = next_view(board, (rgb.shape[1], rgb.shape[0]), earlier)
    u, v = quad.mean(axis=0)
    text = Marker(float(u), float(v), "plus", "expected", text=tr("next view"))
    return Overlay(lines=(Line(quad, "expected", closed=True),), markers=(text,))


def glance(image: LinearImage, board: BoardSpec) -> Array:
    """Return approximate corners from the quick detectors, or raise InputError."""
    red, green, blue = cv2.split(image.rgb)
    grey = np.asarray((red + green + blue) / np.float32(3.0), np.float32)
    check_exposure(grey, image.name)
    rough = find_rough_corners(grey, board.inner_corners)
    if rough is None:
        rough = search_rough_corners(grey, board.inner_corners, longest_px=GLANCE_PX)
    if rough is not None:
        return rough
    width_px = sharpest_edge_px(grey)
    if width_px > edge_limit_px(image.size[0]):
        raise blur_error(width_px, edge_limit_px(image.size[0]), image.name)
    raise InputError(
        tr("no board with {w} x {h} inner corners was found").format(
            w=board.inner_corners[0], h=board.inner_corners[1]
        ),
        where=image.name,
        advice=tr("Show the whole board, evenly lit, with a light margin around it"),
    )


def _next_view(view: BoardView, earlier: Sequence[BoardView]) -> tuple[str, bool]:
    """Return the message for a detected view, and whether the view adds information."""
    if any(_moved_px(view, other) < SAME_VIEW_OF_SQUARE * view.square_px for other in earlier):
        return tr(
            "Board found, but the view is like an earlier one. Move or tilt the board."
        ), False
    if view.saturated_share > 0.0:
        text = tr(
            "Board found, but {p:.0f} % of its light squares are saturated. Shorten the exposure."
        )
        return text.format(p=max(100.0 * view.saturated_share, 1.0)), True
    flat = sum(other.tilt_deg < LEAST_TILT_DEG for other in earlier)
    if view.tilt_deg < LEAST_TILT_DEG and flat >= FLAT_VIEWS:
        text = tr(
            "Board found. Tilt it more: now {t:.0f} degrees, best 15 to 40 degrees to any side."
        )
        return text.format(t=view.tilt_deg), False
    area = _uncovered_area([*earlier, view])
    if area:
        return tr("Board found. The {place} of the image has no corners yet.").format(
            place=area
        ), True
    return tr("Board found. The corners cover the whole image."), True


def _moved_px(view: BoardView, other: BoardView) -> float:
    """Return the RMS movement of the corners, for the better of the two board orientations."""
    if view.corners_px.shape != other.corners_px.shape:
        return float("inf")
    moves = (view.corners_px - other.corners_px, view.corners_px - other.corners_px[::-1])
    return min(float(np.sqrt(np.mean(np.sum(move**2, axis=1)))) for move in moves)


def _uncovered_area(views: Sequence[BoardView]) -> str:
    """Return the name of a ninth of the image without any corner, outer ninths first; or ""."""
    names = (
        (tr("top left"), tr("top"), tr("top right")),
        (tr("left"), tr("middle"), tr("right")),
        (tr("bottom left"), tr("bottom"), tr("bottom right")),
    )
    ninth = uncovered_ninth(views)
    return "" if ninth is None else names[ninth[0]][ninth[1]]


def _view_figures(view: BoardView, earlier: Sequence[BoardView]) -> tuple[Figure, ...]:
    covered = coverage_counts([*earlier, view], view.image_size) > 0
    return (
        judge("tilt", tr("Tilt"), view.tilt_deg, "deg"),
        judge("edge_width", tr("Edge width"), view.edge_width_px, "px",
              warn=edge_limit_px(view.image_size[0])),
        judge("grid_rms", tr("Deviation from a flat grid"), view.grid_rms_px, "px"),
        judge("contrast", tr("Contrast"), 100.0 * view.contrast, "%"),
        judge("saturated", tr("Saturated light squares"), 100.0 * view.saturated_share, "%",
              warn=0.0),
        judge("coverage", tr("Image covered by corners"), 100.0 * float(covered.mean()), "%"),
        judge("views", tr("Captured views"), len(earlier)),
    )  # fmt: skip
