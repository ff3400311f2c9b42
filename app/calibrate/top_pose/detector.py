"""Find the checkerboard on the top surface in an image."""

from __future__ import annotations

from app.calibrate.detection import Detection, as_image, judged, or_refusal
from app.calibrate.lens.detector import glance
from app.calibrate.marks import board_corners, board_outline, foot_point
from app.live.image_checks import Rgb
from app.live.overlay import Overlay
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
        As for :func:`~app.calibrate.lens.detector.detect_board`.
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
            view,
        )

    return or_refusal(detect)
