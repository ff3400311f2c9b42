"""Pose of the sensor's top surface, from a checkerboard that lies on it, in air.

Two poses of a flat board explain an image almost equally well; they are mirrored about the viewing
direction. Both are found (IPPE) and refined. The mirrored one is rejected by its larger
reprojection error and by the agreement of the views or, if neither decides, because it tilts more.
The result states which criterion decided.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import Finding, QualityTable, judge, judge_excluded_images
from gelpolight_core.geometry.camera import CameraModel
from gelpolight_core.geometry.sensor_frame import TopPlane
from gelpolight_core.image.linear_image import LinearImage, require_size
from gelpolight_core.session.board import BoardSpec

from .board_exposure import EDGE_OF_SIGMA
from .checkerboard import BoardView
from .lens_views import find_view
from .plane_pose import (
    SURE_MARGIN,
    PlanePose,
    angle_between_deg,
    as_plane,
    find_poses,
    nearest_pose,
    resolve_mirror_ambiguity,
)
from .square_ratio import fit_square_ratio, judge_square_ratio

MOST_LENS_BLUR_PX = 1.0
"""The reconstruction removes up to this blur; the rest of a larger blur makes walls too flat."""


@dataclass(frozen=True, slots=True)
class TopPoseView:
    """The top surface as seen in one image.

    Attributes
    ----------
    name : str
        Name of the image.
    used : bool
        Whether it is used.
    reason : str
        Why it is not used; empty if it is.
    board : BoardView or None
        The corners, if they were found.
    pose : PlanePose or None
        The accepted pose.
    """

    name: str
    used: bool
    reason: str
    board: BoardView | None = None
    pose: PlanePose | None = None


@dataclass(frozen=True, slots=True)
class TopPoseResult:
    """The undeformed top surface.

    Attributes
    ----------
    plane : TopPlane
        Average over the used views; normal pointing away from the camera.
    normal_sd_deg, distance_sd_mm : float
        Standard deviations of the average: the larger of the corners' and of the views' scatter.
    tilt_deg : float
        Angle of the normal to the optical axis.
    blur_px : float
        Standard deviation of the blur of lens and pixel on the top surface, from the edges of the
        squares; median over the used views.
    views : tuple of TopPoseView
        All images in the given order.
    quality : QualityTable
        The judged figures.
    """

    plane: TopPlane
    normal_sd_deg: float
    distance_sd_mm: float
    tilt_deg: float
    blur_px: float
    views: tuple[TopPoseView, ...]
    quality: QualityTable


def estimate_top_pose(
    images: Sequence[LinearImage],
    board: BoardSpec,
    camera: CameraModel,
    *,
    focal_sd_px: float = 0.0,
    refused: Mapping[str, InputError] | None = None,
) -> TopPoseResult:
    """Find the top surface from views of a checkerboard that lies flat on it, without elastomer.

    Parameters
    ----------
    images : sequence of LinearImage
        One or more views; the board may lie differently in each.
    board : BoardSpec
        The board on the surface.
    camera : CameraModel
        From :func:`gelpolight_core.stages.checkerboards.lens.calibrate_lens`.
    focal_sd_px : float, optional
        Standard deviation of the focal length; it limits the accuracy of the distance.
    refused : mapping of str to InputError, optional
        Images that cannot be used at all, by name: they become unused views.

    Returns
    -------
    TopPoseResult
        The plane, its uncertainty, and the views.

    Raises
    ------
    InputError
        If there is no image, the size differs from the camera's, none shows the board, or three or
        more boards all lie in different planes.
    """
    if not images:
        text = "There is no image of the board on the top surface"
        raise InputError(text, "top_pose", Remedy.BOARD_ON_TOP)
    for image in images:
        require_size(image.size, (camera.width, camera.height), where=f"top_pose/{image.name}")
    found_views = [find_view(image, board) for image in images]
    candidates = [[] if v.board is None else find_poses(v.board, camera) for v in found_views]
    if not any(candidates):
        first = found_views[0]
        raise InputError(first.reason, f"top_pose/{first.name}", first.advice)
    reference, margin = resolve_mirror_ambiguity([poses for poses in candidates if poses])
    views = []
    for view, poses in zip(found_views, candidates, strict=True):
        pose = nearest_pose(poses, reference) if poses else None
        views.append(TopPoseView(view.name, view.used, view.reason, view.board, pose))
    views = _leave_out_strays(views)
    views += [TopPoseView(name, False, fault.found) for name, fault in (refused or {}).items()]
    return _assemble(views, camera, margin, focal_sd_px)


def _leave_out_strays(views: list[TopPoseView]) -> list[TopPoseView]:
    """Leave out views whose plane differs from the others, given three or more views."""
    poses = [view.pose for view in views if view.used and view.pose is not None]
    if len(poses) < 3:
        return views
    normal = np.median([pose.plane.normal_camera for pose in poses], axis=0)
    median_plane = as_plane(
        normal / np.linalg.norm(normal), float(np.median([p.plane.distance_mm for p in poses]))
    )
    checked = []
    for view in views:
        if view.pose is not None:
            angle_deg = angle_between_deg(view.pose.plane, median_plane)
            deviation_mm = abs(view.pose.plane.distance_mm - median_plane.distance_mm)
            # Half a degree is 0.1 mm under one end of a board: it does not lie on the surface.
            if angle_deg > max(0.5, 5.0 * view.pose.normal_sd_deg) or deviation_mm > max(
                0.005 * median_plane.distance_mm, 5.0 * view.pose.distance_sd_mm
            ):
                reason = (
                    f"The board deviates by {angle_deg:.2f} degrees and {deviation_mm:.2f} mm from "
                    "the others"
                )
                view = replace(view, used=False, reason=reason)
        checked.append(view)
    _refuse_discord(checked, len(poses))
    return checked


def _refuse_discord(views: Sequence[TopPoseView], count: int) -> None:
    """Refuse `count` boards of which no two lie in one plane: none is known to be right."""
    if sum(view.used for view in views) >= 2:
        return
    strays = [view for view in views if view.pose is not None and not view.used]
    names = "; ".join(f"{view.name}: {view.reason}" for view in strays)
    text = f"The {count} boards do not lie in one plane ({names})"
    raise InputError(text, "top_pose", Remedy.BOARD_ON_TOP)


def _average(poses: Sequence[PlanePose]) -> tuple[TopPlane, float, float]:
    """Return the average plane and the standard deviations of its normal (deg) and distance."""
    normals = np.array([pose.plane.normal_camera for pose in poses])
    distances = np.array([pose.plane.distance_mm for pose in poses])
    # Equal weights below the flatness of real boards, which the residuals do not include.
    normal_weights = np.array([1.0 / math.hypot(p.normal_sd_deg, 1e-3) ** 2 for p in poses])
    distance_weights = np.array([1.0 / math.hypot(p.distance_sd_mm, 1e-4) ** 2 for p in poses])
    normal = normal_weights @ normals
    normal /= np.linalg.norm(normal)
    distance = float(distance_weights @ distances / distance_weights.sum())
    normal_sd_deg = 1.0 / math.sqrt(float(normal_weights.sum()))
    distance_sd_mm = 1.0 / math.sqrt(float(distance_weights.sum()))
    count = len(poses)
    if count > 1:
        share = count * (count - 1.0)
        scatter = math.sqrt(float(np.sum((normals - normal) ** 2)) / share)
        normal_sd_deg = max(normal_sd_deg, math.degrees(scatter))
        distance_sd_mm = max(
            distance_sd_mm, math.sqrt(float(np.sum((distances - distance) ** 2)) / share)
        )
    return as_plane(normal, distance), normal_sd_deg, distance_sd_mm


def _assemble(
    views: Sequence[TopPoseView], camera: CameraModel, margin: float, focal_sd_px: float
) -> TopPoseResult:
    used = [view for view in views if view.used]
    poses = [view.pose for view in used if view.pose is not None]
    plane, normal_sd_deg, distance_sd_mm = _average(poses)
    by_focal = plane.distance_mm * focal_sd_px / math.sqrt(camera.fx * camera.fy)
    distance_sd_mm = math.hypot(distance_sd_mm, by_focal)
    tilt_deg = math.degrees(math.acos(min(1.0, plane.normal_camera[2])))
    rms = float(np.sqrt(np.mean([pose.rms_px**2 for pose in poses])))
    boards = [view.board for view in used if view.board is not None]
    edges_px = [board.edge_width_px for board in boards]
    blur_px = float(np.median(edges_px)) / EDGE_OF_SIGMA
    spread_deg = max(angle_between_deg(pose.plane, plane) for pose in poses)
    ratio = fit_square_ratio(boards, camera, lens_known=True)
    figures = (
        *judge_square_ratio(ratio, boards[0].board),
        *_plane_figures(plane, normal_sd_deg, distance_sd_mm, tilt_deg),
        *_view_figures(views, rms, spread_deg, margin),
        judge(
            "blur",
            "Blur on the top surface",
            blur_px,
            "px",
            warn=MOST_LENS_BLUR_PX,
            remedy="Focus the lens on the top surface and keep the board still; blur rounds off "
            "walls and edges",
        ),
    )
    return TopPoseResult(
        plane=plane,
        normal_sd_deg=normal_sd_deg,
        distance_sd_mm=distance_sd_mm,
        tilt_deg=tilt_deg,
        blur_px=blur_px,
        views=tuple(views),
        quality=QualityTable(figures),
    )


def _plane_figures(
    plane: TopPlane, normal_sd_deg: float, distance_sd_mm: float, tilt_deg: float
) -> tuple[Finding, ...]:
    more = (
        "Capture several sharp views of a flat board that fills the top surface, with the lens at"
        " the focus of its calibration"
    )
    distance_text, normal_text = "Uncertainty of the distance", "Uncertainty of the normal"
    tilt_text = "Tilt of the top surface"
    press = "Press the board flat onto the surface; check how the camera is mounted"
    sd_percent = 100.0 * distance_sd_mm / plane.distance_mm
    return (
        judge("distance", "Distance of the top surface", plane.distance_mm, "mm"),
        judge("distance_sd", distance_text, sd_percent, "%", warn=0.1, fail=1.0, remedy=more),
        # A tilt error of one degree moves a mirrored LED by 1 mm (see "lights from mirror spots").
        judge("normal_sd", normal_text, normal_sd_deg, "deg", warn=0.1, fail=1.0, remedy=more),
        judge("tilt", tilt_text, tilt_deg, "deg", warn=5.0, fail=20.0, remedy=press),
    )


def _view_figures(
    views: Sequence[TopPoseView], rms: float, spread_deg: float, margin: float
) -> tuple[Finding, ...]:
    refused = [f"{view.name} ({view.reason})" for view in views if not view.used]
    figures = [
        judge(
            "reprojection_rms",
            "Reprojection error",
            rms,
            "px",
            warn=0.3,
            fail=1.0,
            remedy="Use a flat board and check its square size; calibrate the lens again",
        ),
        judge(
            "view_spread",
            "Largest angle between a view and the average",
            spread_deg,
            "deg",
            warn=0.25,
            fail=1.0,
            remedy="Press the board flat onto the surface in each view",
        ),
        judge_excluded_images("views_left_out", "Views left out", refused),
    ]
    if math.isfinite(margin):  # else there was only one pose: the board faces the camera
        remedy = (
            "Two mirrored poses fit the views equally well; the one with the smaller tilt was "
            "chosen. To be sure, use a larger or sharper board"
        )
        label, certainty = "Certainty against the mirrored pose", math.sqrt(max(margin, 0.0))
        figures.append(
            judge(
                "mirrored_margin",
                label,
                certainty,
                "sd",
                warn=math.sqrt(SURE_MARGIN),
                higher_is_better=True,
                remedy=remedy,
            )
        )
    return tuple(figures)
