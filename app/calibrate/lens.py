"""The lens step: views of a checkerboard in front of the camera, and which view to show next."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from app.calibrate.detection import Detection, Detector, as_image, or_refusal
from app.calibrate.image_step import ImageStep
from app.calibrate.marks import board_corners, board_outline
from app.calibrate.step import Parts
from app.calibrate.step_data import step_of
from app.live.image_checks import Rgb
from app.live.overlay import Line, Marker, Overlay
from app.services.jobs import Job
from gelpolight_core.calibration.open_sensor import LENS
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.finding import Finding, Verdict
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
from gelpolight_core.optics.lens_views import (
    MIN_VIEWS,
    LensRefusal,
    LensView,
    find_view,
    refused_view,
)
from gelpolight_core.session.board import BoardSpec
from gelpolight_core.translation import tr

Array = NDArray[np.float64]
Ninth = tuple[int, int]

ORDER: tuple[Ninth, ...] = (
    (0, 0), (0, 2), (2, 2), (2, 0), (0, 1), (1, 2), (2, 1), (1, 0), (1, 1),
)  # fmt: skip
"""(row, column) of the ninths of the image, the outer ones first."""
BOARD_OF_WIDTH = 0.45
FOCAL_OF_WIDTH = 1.0
TILT_DEG = 25.0
# The golden angle: any number of successive directions is spread evenly.
TURN_DEG = 137.5
MARGIN_OF_WIDTH = 0.02


def uncovered_ninth(views: Sequence[BoardView]) -> Ninth | None:
    """Return (row, column) of a ninth of the image without any corner, outer ninths first."""
    if not views:
        return ORDER[0]
    counts = coverage_counts(views, views[0].image_size)
    rows = [part.sum(axis=0) for part in np.array_split(counts, 3, axis=0)]
    ninths = np.array([[p.sum() for p in np.array_split(row, 3)] for row in rows])
    return next((ninth for ninth in ORDER if ninths[ninth] == 0), None)


def next_view(board: BoardSpec, size: tuple[int, int], earlier: Sequence[BoardView]) -> Array:
    """Return the outermost inner corners (4, 2) of a board in the suggested pose, in pixels.

    Each view has another tilt direction; it is placed where no view has corners yet.

    Parameters
    ----------
    board : BoardSpec
        The board.
    size : (width, height)
        Of the image, in pixels.
    earlier : sequence of BoardView
        Views captured before.
    """
    width, height = size
    across, down = (count - 1 for count in board.inner_corners)
    x, y = 0.5 * across, 0.5 * down
    corners = np.array([[-x, -y, 0.0], [x, -y, 0.0], [x, y, 0.0], [-x, y, 0.0]])
    turn = math.radians(TURN_DEG * len(earlier))
    axis = np.array([math.cos(turn), math.sin(turn), 0.0])
    tilted = _rotated(corners, axis, math.radians(TILT_DEG))
    focal = FOCAL_OF_WIDTH * width
    tilted[:, 2] += focal * across / (BOARD_OF_WIDTH * width)
    quad = focal * tilted[:, :2] / tilted[:, 2:]
    row, column = uncovered_ninth(earlier) or ORDER[len(earlier) % len(ORDER)]
    quad += [(column + 0.5) * width / 3.0, (row + 0.5) * height / 3.0]
    return _moved_inside(quad, np.array(size, np.float64), MARGIN_OF_WIDTH * width)


def _rotated(points: Array, axis: Array, angle: float) -> Array:
    along = np.outer(points @ axis, axis)
    turned = np.cross(axis, points) * math.sin(angle)
    return np.asarray(along + (points - along) * math.cos(angle) + turned)


def _moved_inside(quad: Array, size: Array, margin: float) -> Array:
    """Return a quadrilateral shifted into the image."""
    low = np.maximum(margin - quad.min(axis=0), 0.0)
    high = np.minimum(size - 1.0 - margin - quad.max(axis=0), 0.0)
    return np.asarray(quad + low + high)


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
        finding = _next_view(view, earlier)
        if finding.verdict is Verdict.FAIL:  # shows where to move the board
            marks = replace(
                marks,
                lines=(*marks.lines, *wanted.lines),
                markers=(*marks.markers, *wanted.markers),
            )
        return Detection(marks, finding)

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
        advice=Remedy.SHOW_BOARD,
    )


def _next_view(view: BoardView, earlier: Sequence[BoardView]) -> Finding:
    """Return what a detected view adds to the earlier ones; a failure adds nothing."""
    if any(_moved_px(view, other) < SAME_VIEW_OF_SQUARE * view.square_px for other in earlier):
        text = tr("Board found, but the view is like an earlier one. Move or tilt the board.")
        return Finding("same_view", text, verdict=Verdict.FAIL)
    if view.saturated_share > 0.0:
        text = tr(
            "Board found, but {p:.0f} % of its light squares are saturated. Shorten the exposure."
        )
        return Finding("saturated", text.format(p=max(100.0 * view.saturated_share, 1.0)))
    flat = sum(other.tilt_deg < LEAST_TILT_DEG for other in earlier)
    if view.tilt_deg < LEAST_TILT_DEG and flat >= FLAT_VIEWS:
        text = tr(
            "Board found. Tilt it more: now {t:.0f} degrees, best 15 to 40 degrees to any side."
        )
        return Finding("tilt", text.format(t=view.tilt_deg), verdict=Verdict.FAIL)
    text = tr("Board found. The corners cover the whole image.")
    if area := _uncovered_area([*earlier, view]):
        text = tr("Board found. The {place} of the image has no corners yet.").format(place=area)
    return Finding("coverage", text)


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


class LensStep(ImageStep):
    """Analyses each view at once, before there are enough of them to compute the lens."""

    judges_focus = True

    def __init__(self, parts: Parts) -> None:
        super().__init__(parts)
        self._views: dict[str, LensView] = {}
        self.model.captured.connect(self._on_captured)

    step = step_of(
        LENS,
        tr(
            "Hold the checkerboard in front of the camera, tilted in a new direction for each "
            "image."
        ),
        "camera",
        frames=1,
        wanted=12,
        least=MIN_VIEWS,
        advice=tr(
            "Use the camera alone. Tilt the board by 15 to 40 degrees, until its corners have "
            "covered the whole image."
        ),
    )

    def start(self) -> None:
        """Analyse the views that the session has."""
        self._find_boards()

    def views(self) -> dict[str, LensView]:
        """Return what was found in each analysed view, by image name."""
        project = self.model.project
        fault, lens = project.fault("lens"), project.results.get(LENS)
        views = () if lens is None else lens.views
        if isinstance(fault, LensRefusal):
            views = fault.views  # the reasons survive a refusal
        return {**self._views, **{view.name: view for view in views}}

    def detector(self, name: str) -> Detector:
        """Return the detection of the board, with the earlier views."""
        session = self.model.project.session
        used = {path.name for path in session.found(self.step.folder)} - {name}
        found = [view.board for n, view in self.views().items() if n in used]
        earlier = [board for board in found if board is not None]
        return partial(
            detect_board, board=session.checkerboard, earlier=earlier, patient=bool(name)
        )

    def depends_on(self) -> tuple[Any, ...]:
        """Return the names of the analysed views."""
        return (frozenset(self.views()),)

    def judge(self, path: Path) -> Finding | None:
        """Return what was found in a view."""
        return judge_view(self.views().get(path.name))

    def _on_captured(self, stage: str, _name: str) -> None:
        if stage == "lens":
            self._find_boards()

    def _find_boards(self) -> None:
        def work(_progress: Callable[[float], None]) -> None:
            session, known = self.model.project.session, self.views()
            for path in session.found(self.step.folder):
                if path.name not in known:
                    try:
                        view = find_view(session.image(path), session.checkerboard)
                    except InputError as fault:
                        view = refused_view(path.name, fault)
                    self._views = {**self._views, path.name: view}

        self.model.short_jobs.submit(
            Job(tr("Analysing the lens views"), work, lambda _: self.model.changed.emit())
        )


def judge_view(view: LensView | None) -> Finding | None:
    """Return how a lens view was judged; None: it was not analysed yet."""
    if view is None:
        return None
    if not view.used:
        return Finding("view", view.reason, verdict=Verdict.FAIL)
    if math.isnan(view.rms_px):
        return Finding("view", tr("Board found"))
    return Finding("corner_error_px", tr("Corner error"), view.rms_px, "px")
