"""The top surface step: a checkerboard on the top opening of the housing."""

from __future__ import annotations

from functools import partial
from pathlib import Path

from app.calibrate.detection import Detection, Detector, as_image, judged, or_refusal, too_early
from app.calibrate.image_step import ImageStep, judged_stage
from app.calibrate.lens import glance
from app.calibrate.marks import board_corners, board_outline, foot_point
from app.calibrate.step_data import step_of
from app.live.image_checks import Rgb
from app.live.overlay import Overlay
from gelpolight_core.calibration.open_sensor import LENS, TOP_POSE
from gelpolight_core.calibration.project import Project
from gelpolight_core.calibration.status import StageStatus
from gelpolight_core.finding import Finding, Verdict
from gelpolight_core.optics.camera import Camera
from gelpolight_core.optics.pose import estimate_top_pose
from gelpolight_core.session.board import BoardSpec
from gelpolight_core.translation import tr


def detect_top_pose(
    rgb: Rgb, board: BoardSpec, camera: Camera, *, patient: bool = False
) -> Detection:
    """Find the board on the top surface and return the pose of the surface.

    Parameters
    ----------
    rgb : (rows, columns, 3)
        The frame.
    board : BoardSpec
        The board on the surface.
    camera : Camera
        Result of the lens stage.
    patient : bool, optional
        As for :func:`~app.calibrate.lens.detect_board`.
    """

    def detect() -> Detection:
        image = as_image(rgb, tr("Image"))
        if not patient:
            glance(image, board)
        pose = estimate_top_pose([image], board, camera)
        view = pose.views[0].board
        markers = () if view is None else board_corners(view)
        lines = () if view is None else (board_outline(view, "good"),)
        marks = Overlay(markers=(*markers, foot_point(camera, pose.plane)), lines=lines)
        good = tr("Board found. The top surface is at {d:.2f} mm and tilted by {t:.2f} degrees.")
        return judged(
            marks,
            pose.quality.figures,
            good.format(d=pose.plane.distance_mm, t=pose.tilt_deg),
        )

    return or_refusal(detect)


class TopPoseStep(ImageStep):
    """Finds the board with the lens of the step before."""

    step = step_of(
        TOP_POSE,
        tr("Lay the small checkerboard flat on the top opening, pattern facing down."),
        "board",
        frames=8,
        wanted=1,
        advice=tr("Mount the housing without the elastomer."),
        figure="reprojection_rms",
    )

    def detector(self, name: str) -> Detector:
        """Return the detection of the board, once the lens is known."""
        project = self.model.project
        lens = project.results.get(LENS)
        if lens is None:
            return too_early
        board = project.session.top_pose
        return partial(detect_top_pose, board=board, camera=lens.camera, patient=bool(name))

    def judge(self, path: Path) -> Finding | None:
        """Return whether a view is used."""
        return judge_top_view(path.name, self.model.project, self.model.statuses[self.stage])


def judge_top_view(name: str, project: Project, status: StageStatus) -> Finding | None:
    """Return how a view of the top surface was judged."""
    found, top = judged_stage(status), project.results.get(TOP_POSE)
    if found is not None and status.quality.figures and top is not None:
        for view in top.pose.views:
            if view.name == name and not view.used:
                return Finding("view", view.reason, verdict=Verdict.FAIL)
    return found
