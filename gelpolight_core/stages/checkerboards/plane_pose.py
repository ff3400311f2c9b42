"""The one or two possible poses of a board in a view, with their uncertainty."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.geometry.camera import CameraModel
from gelpolight_core.geometry.sensor_frame import TopPlane

from .checkerboard import BoardView

# Differences of chi-square: five standard deviations decide between a pose and its mirror image.
SURE_MARGIN = 25.0


@dataclass(frozen=True, slots=True)
class PlanePose:
    """One pose of the board in one view.

    Attributes
    ----------
    plane : TopPlane
        The board's plane in the camera frame.
    rms_px : float
        Reprojection error.
    tilt_deg : float
        Angle of the plane's normal to the optical axis.
    normal_sd_deg, distance_sd_mm : float
        Standard deviations from the corners' residuals, for the given camera.
    residuals_px : (N, 2)
        Projected minus measured corner.
    """

    plane: TopPlane
    rms_px: float
    tilt_deg: float
    normal_sd_deg: float
    distance_sd_mm: float
    residuals_px: Float64Array


def find_poses(view: BoardView, camera: CameraModel) -> list[PlanePose]:
    """Find the one or two poses of a board (IPPE), and refine them.

    Parameters
    ----------
    view : BoardView
        Its corners.
    camera : CameraModel
        The calibrated camera.

    Returns
    -------
    list of PlanePose
        The one with the smaller error first.
    """
    points, distortion = view.board.points_mm, np.array(camera.distortion)
    _, rotations, shifts, _ = cv2.solvePnPGeneric(
        points, view.corners_px, camera.matrix, distortion, flags=cv2.SOLVEPNP_IPPE
    )
    criteria = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 100, 1e-12)
    poses = []
    starts = []
    for turn, shift in zip(rotations, shifts, strict=True):
        # Before the refinement, which overwrites its start values.
        starts.append(_describe_pose(view, camera, turn, shift))
        refined = cv2.solvePnPRefineLM(
            points, view.corners_px, camera.matrix, distortion, turn, shift, criteria
        )
        poses.append(_describe_pose(view, camera, refined[0], refined[1]))
    poses.sort(key=lambda pose: pose.rms_px)
    best = poses[0]
    if len(poses) == 1:
        return [best]
    # Refinement may move from the mirrored pose to the true one, which rejects the mirrored pose;
    # the pose before refinement is then reported.
    twin = poses[1]
    if _are_one(twin, best):
        twin = max(starts, key=lambda pose: pose.rms_px)
    return [best] if _are_one(twin, best) else [best, twin]


def _are_one(pose: PlanePose, other: PlanePose) -> bool:
    """Whether two poses differ by less than the corners can resolve."""
    return angle_between_deg(pose.plane, other.plane) < max(5.0 * other.normal_sd_deg, 1e-4)


def _describe_pose(
    view: BoardView, camera: CameraModel, turn: NDArray[Any], shift: NDArray[Any]
) -> PlanePose:
    rotation = np.asarray(cv2.Rodrigues(turn)[0], dtype=np.float64)
    shift_mm = np.asarray(shift, dtype=np.float64).ravel()
    turned = view.board.points_mm @ rotation.T
    residuals = camera.project(turned + shift_mm) - view.corners_px
    normal = rotation[:, 2] if rotation[:, 2] @ shift_mm > 0.0 else -rotation[:, 2]
    slopes = _pose_slopes(camera, turned, shift_mm)
    freedom = max(residuals.size - 6, 1)
    variance = float(np.sum(residuals**2)) / freedom
    covariance = variance * np.linalg.inv(slopes.T @ slopes)
    # n turns by w x n, and the distance n . t changes by (w x n) . t + n . dt.
    normal_by_turn = np.cross(np.eye(3), normal).T
    distance_by_pose = np.concatenate([np.cross(normal, shift_mm), normal])
    normal_variance = np.trace(normal_by_turn @ covariance[:3, :3] @ normal_by_turn.T)
    return PlanePose(
        plane=as_plane(normal, float(normal @ shift_mm)),
        rms_px=float(np.sqrt(np.mean(np.sum(residuals**2, axis=1)))),
        tilt_deg=math.degrees(math.acos(min(1.0, float(normal[2])))),
        normal_sd_deg=math.degrees(math.sqrt(max(float(normal_variance), 0.0))),
        distance_sd_mm=math.sqrt(max(float(distance_by_pose @ covariance @ distance_by_pose), 0.0)),
        residuals_px=residuals,
    )


def _pose_slopes(camera: CameraModel, turned: Float64Array, shift_mm: Float64Array) -> Float64Array:
    """Return d(corners)/d(small rotation about the board's origin, shift), (2N, 6)."""
    columns = []
    points, step = turned + shift_mm, 1e-5
    for axis in np.eye(3):
        for move in (np.cross(axis, turned), np.broadcast_to(axis, turned.shape)):
            ahead, behind = (
                camera.project(points + step * move),
                camera.project(points - step * move),
            )
            columns.append((ahead - behind).ravel() / (2.0 * step))
    return np.stack([*columns[::2], *columns[1::2]], axis=1)


def as_plane(normal: Float64Array, distance_mm: float) -> TopPlane:
    """Return a plane from its normal as an array.

    Parameters
    ----------
    normal : (3,)
        Unit normal, away from the camera.
    distance_mm : float
        Distance from the optical centre.
    """
    return TopPlane((float(normal[0]), float(normal[1]), float(normal[2])), distance_mm)


def angle_between_deg(plane: TopPlane, other: TopPlane) -> float:
    """Return the angle between two planes.

    Parameters
    ----------
    plane, other : TopPlane
        In the camera frame.
    """
    a, b = np.array(plane.normal_camera), np.array(other.normal_camera)
    return math.degrees(math.atan2(float(np.linalg.norm(np.cross(a, b))), float(a @ b)))


def resolve_mirror_ambiguity(candidates: Sequence[Sequence[PlanePose]]) -> tuple[PlanePose, float]:
    """Return a pose on the true side, and the chi-square by which the other side is worse.

    Every candidate is tested as the truth. Each view adds two terms: how much worse its nearest
    candidate fits its corners than its best candidate, and how far that lies from the tested one.
    The latter is bounded, so that a board that does not lie flat cannot outvote the rest. If the
    margin is too small to decide, the side with the smaller tilt is chosen: sensor cameras are
    built to face their top surface.

    Parameters
    ----------
    candidates : sequence of sequences of PlanePose
        The one or two poses of each view, the one with the smaller error first.

    Returns
    -------
    truth : PlanePose
        One of the candidates.
    margin : float
        Difference of chi-square, never negative; infinite if there is no other side.
    """
    costs = [
        (sum(_pose_cost(view, nearest_pose(view, pose), pose) for view in candidates), pose)
        for pose in chain.from_iterable(candidates)
    ]
    cost, best = min(costs, key=lambda item: item[0])
    same_side = [nearest_pose(view, best) for view in candidates]
    others = [item for item in costs if not any(item[1] is pose for pose in same_side)]
    if not others:
        return best, math.inf
    other_cost, other = min(others, key=lambda item: item[0])
    margin = other_cost - cost
    if margin < SURE_MARGIN and other.tilt_deg < best.tilt_deg:
        return other, margin
    return best, margin


def nearest_pose(view: Sequence[PlanePose], truth: PlanePose) -> PlanePose:
    """Return the pose of one view that is nearest to a pose assumed to be true.

    Parameters
    ----------
    view : sequence of PlanePose
        Its one or two poses, the one with the smaller error first.
    truth : PlanePose
        A pose of this or another view.
    """
    return min(view, key=lambda pose: _pose_cost(view, pose, truth))


def _pose_cost(view: Sequence[PlanePose], pose: PlanePose, truth: PlanePose) -> float:
    best = view[0]
    freedom = max(best.residuals_px.size - 6, 1)
    worse = freedom * (pose.rms_px**2 / max(best.rms_px**2, 1e-12) - 1.0)
    # Boards pressed onto the same surface agree within 0.05 degrees: a lower limit of the scatter.
    sd_deg = math.hypot(0.05, best.normal_sd_deg)
    return worse + min(
        (angle_between_deg(pose.plane, truth.plane) / sd_deg) ** 2, 4.0 * SURE_MARGIN
    )
