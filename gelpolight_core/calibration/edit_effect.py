"""The effect of edited reflectance curves on the depth of a ball press.

It uses the model of the calibration: the full model once the joint refinement is known.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from gelpolight_core.base.arrays import Float64Array
from gelpolight_core.reconstruction.reconstructor import SOLVERS
from gelpolight_core.reconstruction.solver import SolveRequest
from gelpolight_core.reconstruction.trace import EFFORTS
from gelpolight_core.session.session_images import read_linear_image

from .joint_stage import JOINT
from .open_ball_stages import REFLECTANCE
from .project import CalibrationRun
from .reflectance_edit import CurveNodes, with_edited_curves

REACH = 2.0
"""Length of the line to either side of the centre, in contact radii."""


@dataclass(frozen=True, slots=True)
class CurveEditEffect:
    """Depth of a press along x through the ball's centre, compared with the ball.

    Attributes
    ----------
    position_mm : (N,)
        Positions along x, from the ball's centre.
    profile_mm : (N,)
        Reconstructed depth.
    sphere_mm : (N,)
        Depth of the ball's surface; NaN outside of the contact.
    rms_mm : float
        Root mean square of depth minus ball over the whole contact.
    lowest_mm : float
        Depth minus ball, averaged over the inner tenth of the contact's area.
    """

    position_mm: Float64Array
    profile_mm: Float64Array
    sphere_mm: Float64Array
    rms_mm: float
    lowest_mm: float

    @property
    def residual_mm(self) -> Float64Array:
        """Depth minus ball along the line, (N,), NaN outside of the contact."""
        return self.profile_mm - self.sphere_mm


EditEffectFunction = Callable[[Mapping[int, CurveNodes], str], CurveEditEffect]
"""From nodes (cosines, values) of curves by channel, and the name of a press."""


def ball_effect(run: CalibrationRun) -> EditEffectFunction:
    """Return what reconstructs a press with other reflectance curves.

    Parameters
    ----------
    run : CalibrationRun
        Gives the presses and everything except the curves.
    """
    calibration = run.calibration
    request = SolveRequest(effort=EFFORTS[0], normals=False, everywhere=True)

    @lru_cache(maxsize=2)
    def frame(name: str) -> NDArray[np.float32]:
        return read_linear_image(run.session.folder / name, response=calibration.response).rgb

    def effect(curves: Mapping[int, CurveNodes], name: str) -> CurveEditEffect:
        changed = with_edited_curves(calibration, curves, operator="", made="")
        solver = SOLVERS[calibration.model](changed.data, workers=1)
        return _compare(solver.depth(frame(name), request).depth_mm.astype(np.float64), name, run)

    return effect


def _compare(depth: Float64Array, name: str, run: CalibrationRun) -> CurveEditEffect:
    """Compare with the ball where the model shows it."""
    press = next(press for press in run.results[REFLECTANCE].table.presses if press.name == name)
    table = run.calibration.table
    grid, pose, contact = table.grid, press.pose, press.contact_radius_mm
    joint = run.results.get(JOINT)
    if joint is not None and name in joint.refined.ball_names:
        pose = joint.refined.balls[joint.refined.ball_names.index(name)]
        centre = np.asarray(pose.centre_mm)
    else:
        # The paper's model shows it straight below the seen contact.
        column, row = np.round(grid.to_index(np.asarray(pose.centre_mm))).astype(int)
        centre = press.seen_centre_mm(table.ray_slope[row, column].astype(np.float64))
    x, y = grid.x_mm - centre[0], grid.y_mm - centre[1]
    distance2_mm2 = x[None, :] ** 2 + y[:, None] ** 2
    inside = distance2_mm2 < contact**2
    top = pose.depth_mm - pose.radius_mm
    ball = top + np.sqrt(np.where(inside, pose.radius_mm**2 - distance2_mm2, np.nan))
    residual_mm = depth - ball
    line = int(np.abs(y).argmin())
    near = np.flatnonzero(np.abs(x) <= REACH * contact)
    return CurveEditEffect(
        x[near],
        depth[line, near],
        ball[line, near],
        float(np.sqrt(np.mean(residual_mm[inside] ** 2))),
        float(np.mean(residual_mm[distance2_mm2 < 0.1 * contact**2])),
    )
