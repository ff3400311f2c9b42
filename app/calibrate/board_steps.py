"""The steps of a checkerboard: views in front of the camera, then the board on the top opening."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from app.live.overlay import ImageOverlay, OverlayLine, OverlayMarker
from app.program.jobs import BackgroundJob
from gelpolight_core.base.arrays import Float64Array, PixelArray
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import Finding, Verdict
from gelpolight_core.calibration.open_sensor_recipe import LENS, TOP_POSE
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.calibration.stage_status import StageStatus
from gelpolight_core.geometry.camera import CameraModel
from gelpolight_core.image.linear_image import LinearImage
from gelpolight_core.session.board import BoardSpec
from gelpolight_core.stages.checkerboards.board_exposure import (
    check_exposure,
    edge_limit_px,
    sharpest_edge_px,
)
from gelpolight_core.stages.checkerboards.board_search import (
    find_rough_corners,
    search_rough_corners,
)
from gelpolight_core.stages.checkerboards.checkerboard import BoardView, find_board
from gelpolight_core.stages.checkerboards.lens_views import (
    MIN_VIEWS,
    LensRefusal,
    LensView,
    find_view,
    refused_view,
)
from gelpolight_core.stages.checkerboards.next_board_view import next_view, uncovered_ninth
from gelpolight_core.stages.checkerboards.top_surface_pose import estimate_top_pose

from .detection_marks import (
    Detection,
    Detector,
    as_image,
    board_marks,
    board_outline,
    detect_nothing,
    detect_or_refusal,
    foot_point,
    judged_detection,
)
from .image_step import ImageStep, judged_stage

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
    rgb: PixelArray, board: BoardSpec, *, earlier: Sequence[BoardView] = (), patient: bool = False
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
    captured = ImageOverlay(lines=tuple(board_outline(view, "info") for view in earlier))
    suggestion = ImageOverlay() if patient else _suggested(rgb, board, earlier)

    def detect() -> Detection:
        image = as_image(rgb)
        view = find_board(image, board, rough=None if patient else quick_corners(image, board))
        marks = captured + board_marks(view)
        finding = _next_view(view, earlier)
        if finding.verdict is Verdict.FAIL:
            marks += suggestion  # where to move the board
        return Detection(marks, finding)

    return detect_or_refusal(detect, marks=captured + suggestion)


def _suggested(rgb: PixelArray, board: BoardSpec, earlier: Sequence[BoardView]) -> ImageOverlay:
    """Return the outline of the suggested next view."""
    quad = next_view(board, (rgb.shape[1], rgb.shape[0]), earlier)
    u, v = quad.mean(axis=0)
    text = OverlayMarker(float(u), float(v), "plus", "expected", text="next view")
    return ImageOverlay(lines=(OverlayLine(quad, "expected", closed=True),), markers=(text,))


def quick_corners(image: LinearImage, board: BoardSpec) -> Float64Array:
    """Return approximate corners from the quick detectors, or raise InputError."""
    red, green, blue = cv2.split(image.rgb)
    grey = np.asarray((red + green + blue) / np.float32(3.0), np.float32)
    check_exposure(grey, image.name)
    rough = find_rough_corners(grey, board.inner_corners)
    if rough is None:
        rough = search_rough_corners(grey, board.inner_corners, longest_px=GLANCE_PX)
    if rough is not None:
        return rough
    columns, rows = board.inner_corners
    message = f"no board with {columns} x {rows} inner corners was found"
    if sharpest_edge_px(grey) > edge_limit_px(image.size[0]):
        message += ", or it is blurred"
    raise InputError(message, image.name, Remedy.SHOW_BOARD)


def _next_view(view: BoardView, earlier: Sequence[BoardView]) -> Finding:
    """Judge what a detected view adds to the earlier ones. A failure adds nothing."""
    if any(_moved_px(view, other) < SAME_VIEW_OF_SQUARE * view.square_px for other in earlier):
        text = "Board found, but the view is like an earlier one. Move or tilt the board."
        return Finding("same_view", text, verdict=Verdict.FAIL)
    if view.saturated_share > 0.0:
        percent = f"{max(100.0 * view.saturated_share, 1.0):.0f} %"
        text = f"Board found, but {percent} of its light squares are saturated."
        return Finding("saturated", f"{text} Shorten the exposure.")
    flat_count = sum(other.tilt_deg < LEAST_TILT_DEG for other in earlier)
    if view.tilt_deg < LEAST_TILT_DEG and flat_count >= FLAT_VIEWS:
        tilt = f"now {view.tilt_deg:.0f} degrees, best 15 to 40 degrees to any side"
        text = f"Board found. Tilt it more: {tilt}."
        return Finding("tilt", text, verdict=Verdict.FAIL)
    text = "Board found. The corners cover the whole image."
    if area := _uncovered_area([*earlier, view]):
        text = f"Board found. The {area} of the image has no corners yet."
    return Finding("coverage", text)


def _moved_px(view: BoardView, earlier: BoardView) -> float:
    """Return the RMS movement of the corners, for the better of the two board orientations."""
    if view.corners_px.shape != earlier.corners_px.shape:
        return float("inf")
    shifts_px = (view.corners_px - earlier.corners_px, view.corners_px - earlier.corners_px[::-1])
    return min(float(np.sqrt(np.mean(np.sum(shift_px**2, axis=1)))) for shift_px in shifts_px)


def _uncovered_area(views: Sequence[BoardView]) -> str:
    """Return the name of a ninth of the image without any corner, outer ninths first, or ""."""
    names = (
        ("top left", "top", "top right"),
        ("left", "middle", "right"),
        ("bottom left", "bottom", "bottom right"),
    )
    ninth = uncovered_ninth(views)
    return "" if ninth is None else names[ninth[0]][ninth[1]]


class LensStep(ImageStep):
    """Analyses each view at once, before there are enough of them to compute the lens."""

    judges = "dark", "focus"

    of = LENS
    guide = "guide/calibrate", "2-lens"
    task = "Hold the checkerboard in front of the camera, tilted in a new direction for each image."
    assembly = "camera"
    frames, wanted, least = 1, 12, MIN_VIEWS
    advice = "Use the camera alone. Tilt the board by 15 to 40 degrees. Cover the whole image."

    def build(self) -> None:
        """Analyse the views that the session has, and each new one."""
        self._views: dict[str, LensView] = {}
        self.model.captured.connect(self._on_captured)
        self._find_boards()

    def views(self) -> dict[str, LensView]:
        """Return what was found in each analysed view, by image name."""
        fault, lens = self.project.fault("lens"), self.results.get(LENS)
        views = () if lens is None else lens.views
        if isinstance(fault, LensRefusal):
            views = fault.views  # the reasons survive a refusal
        return {**self._views, **{view.name: view for view in views}}

    def detector(self, name: str) -> Detector:
        """Return the detection of the board, with the earlier views."""
        # A captured view is judged by the stage, not as the next one.
        names = set() if name else {path.name for path in self.session.found(self.folder)}
        boards = (view.board for n, view in self.views().items() if n in names)
        earlier = [board for board in boards if board is not None]
        board = self.session.checkerboard
        return partial(detect_board, board=board, earlier=earlier, patient=bool(name))

    def depends_on(self) -> tuple[Any, ...]:
        """Return the names of the analysed views."""
        return (frozenset(self.views()),)

    def judge(self, path: Path) -> Finding | None:
        """Return what was found in a view."""
        return judge_view(self.views().get(path.name))

    def _on_captured(self, stage: str, _name: str) -> None:
        if stage == self.key:
            self._find_boards()

    def _find_boards(self) -> None:
        def work(_progress: Callable[[float], None]) -> None:
            session, analysed = self.session, self.views()
            for path in session.found(self.folder):
                if path.name not in analysed:
                    try:
                        view = find_view(session.image(path), session.checkerboard)
                    except InputError as fault:
                        view = refused_view(path.name, fault)
                    self._views = {**self._views, path.name: view}

        job = BackgroundJob("Analysing the lens views", work, lambda _: self.model.changed.emit())
        self.model.short_jobs.submit(job)


def judge_view(view: LensView | None) -> Finding | None:
    """Return the judgement of a lens view, or None before it is analysed."""
    if view is None:
        return None
    if not view.used:
        return Finding("view", view.reason, verdict=Verdict.FAIL)
    if math.isnan(view.rms_px):
        return Finding("view", "Board found")
    return Finding("corner_error_px", "Corner error", view.rms_px, "px")


def detect_top_pose(
    rgb: PixelArray, board: BoardSpec, camera: CameraModel, *, patient: bool = False
) -> Detection:
    """Find the board on the top surface and return the pose of the surface.

    Parameters
    ----------
    rgb : (rows, columns, 3)
        The frame.
    board : BoardSpec
        The board on the surface.
    camera : CameraModel
        Result of the lens stage.
    patient : bool, optional
        As for :func:`~app.calibrate.board_steps.detect_board`.
    """

    def detect() -> Detection:
        image = as_image(rgb, "Image")
        if not patient:
            quick_corners(image, board)
        pose = estimate_top_pose([image], board, camera)
        view = pose.views[0].board
        marks = ImageOverlay() if view is None else board_marks(view)
        marks += ImageOverlay((foot_point(camera, pose.plane),))
        place = f"at {pose.plane.distance_mm:.2f} mm and tilted by {pose.tilt_deg:.2f} degrees"
        text = f"Board found. The top surface is {place}."
        return judged_detection(marks, pose.quality.figures, text)

    return detect_or_refusal(detect)


class TopPoseStep(ImageStep):
    """Finds the board with the lens of the step before."""

    of = TOP_POSE
    guide = "guide/calibrate", "3-top-surface"
    task = "Lay the small checkerboard flat on the top opening, pattern facing down."
    assembly = "board"
    frames, wanted = 8, 1
    advice = "Mount the housing without the elastomer."
    figure = "reprojection_rms"

    def detector(self, name: str) -> Detector:
        """Return the detection of the board, once the lens is known."""
        lens, board = self.results.get(LENS), self.session.top_pose
        if lens is None:
            return detect_nothing
        return partial(detect_top_pose, board=board, camera=lens.camera, patient=bool(name))

    def judge(self, path: Path) -> Finding | None:
        """Return whether a view is used."""
        return judge_top_view(path.name, self.project, self.model.statuses[self.stage])


def judge_top_view(name: str, project: CalibrationProject, status: StageStatus) -> Finding | None:
    """Return how a view of the top surface was judged."""
    finding, top_pose = judged_stage(status), project.results.get(TOP_POSE)
    if finding is not None and status.quality.figures and top_pose is not None:
        for view in top_pose.pose.views:
            if view.name == name and not view.used:
                return Finding("view", view.reason, verdict=Verdict.FAIL)
    return finding
