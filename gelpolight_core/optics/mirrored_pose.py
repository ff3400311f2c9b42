"""Choose between the two mirrored poses of a board by the evidence of all views."""

from __future__ import annotations

import math
from collections.abc import Sequence

from gelpolight_core.optics.plane_pose import PlanePose, angle_between_deg

# Differences of chi-square: five standard deviations decide between a pose and its mirror image.
SURE_MARGIN = 25.0
# Boards pressed onto the same surface agree better than this; a lower limit of the scatter.
_FLATNESS_DEG = 0.05


def choose_side(candidates: Sequence[Sequence[PlanePose]]) -> tuple[PlanePose, float]:
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
    tried = [(_cost(candidates, pose), pose) for view in candidates for pose in view]
    cost, best = min(tried, key=lambda item: item[0])
    chosen = [nearest_pose(view, best) for view in candidates]
    others = [item for item in tried if not any(item[1] is pose for pose in chosen)]
    if not others:
        return best, math.inf
    other_cost, other = min(others, key=lambda item: item[0])
    margin = other_cost - cost
    if margin < SURE_MARGIN and other.tilt_deg < best.tilt_deg:
        return other, margin
    return best, margin


def _cost(candidates: Sequence[Sequence[PlanePose]], truth: PlanePose) -> float:
    return sum(_pose_cost(view, nearest_pose(view, truth), truth) for view in candidates)


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
    sd_deg = math.hypot(_FLATNESS_DEG, best.normal_sd_deg)
    return worse + min(
        (angle_between_deg(pose.plane, truth.plane) / sd_deg) ** 2, 4.0 * SURE_MARGIN
    )
