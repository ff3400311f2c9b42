"""The effect of edited reflectance curves on a ball press: depth along a line, and its error.

It uses the paper's model, to which the curves belong. Everything that does not depend on the
curves is computed once, so that results arrive while the user is still dragging.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from app.calibrate.reflectance.lut_model import CurveEdit
from gelpolight_core.calibration.edit import edited
from gelpolight_core.calibration.pipeline import CalibrationRun
from gelpolight_core.reconstruction.paper.depth import LOOKUP_SIZE
from gelpolight_core.reconstruction.paper.model import ShadingMaps, solve_slopes
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.reflectance.press import BallPress
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.session.images import read_image
from gelpolight_core.session.session import Session

Array = NDArray[np.float64]
REACH = 2.0
"""Length of the line to either side of the centre, in contact radii."""


@dataclass(frozen=True, slots=True)
class Effect:
    """Depth of a press along x through the ball's centre, compared with the ball.

    Attributes
    ----------
    press : str
        Name of the press.
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

    press: str
    position_mm: Array
    profile_mm: Array
    sphere_mm: Array
    rms_mm: float
    lowest_mm: float

    @property
    def residual_mm(self) -> Array:
        """Depth minus ball along the line; NaN outside of the contact, (N,)."""
        return self.profile_mm - self.sphere_mm


def ball_effect(run: CalibrationRun, session: Session) -> Callable[[CurveEdit, str], Effect]:
    """Return a function of (state, name of press) that reconstructs the press with those curves.

    Parameters
    ----------
    run : CalibrationRun
        Gives the presses and everything except the curves.
    session : Session
        Session with the ball images.
    """
    reconstructor = Reconstructor(run.calibration, model="paper", workers=1)
    presses = {press.name: press for press in run.reflectance.presses}

    @lru_cache(maxsize=2)
    def frame(name: str) -> NDArray[np.float32]:
        return read_image(session.folder / name, response=run.calibration.response).rgb

    def effect(edit: CurveEdit, name: str) -> Effect:
        maps = _maps(reconstructor.paper.maps, run.calibration, edit)
        field = solve_slopes(frame(name), maps, workers=1)
        depth = reconstructor.paper.integration.integrate(field.slope_x, field.slope_y).depth_mm
        return _compare(np.asarray(depth, np.float64), presses[name], run)

    return effect


def _maps(maps: ShadingMaps, calibration: Calibration, edit: CurveEdit) -> ShadingMaps:
    """Return the maps with the edited curves, and with the reflectance factors that result."""
    curves = {k: (np.array(c.curve.cosines), np.array(c.curve.values)) for k, c in enumerate(edit)}
    changed = edited(calibration, curves, operator="", made="")
    lookup, scale = changed.reflectance.lookup(LOOKUP_SIZE)
    old, new = calibration.factors, changed.factors
    gain = maps.gain * np.divide(old, new, out=np.zeros_like(old), where=new > 0.0)
    return replace(maps, lookup=lookup, lookup_scale=scale, gain=gain)


def _compare(depth: Array, press: BallPress, run: CalibrationRun) -> Effect:
    """Compare with the ball where the paper's model shows it: straight below the seen contact."""
    table = run.calibration.table
    grid, pose, contact = table.grid, press.pose, press.contact_radius_mm
    column, row = np.round(grid.to_index(np.asarray(pose.centre_mm))).astype(int)
    centre = press.seen_centre_mm(table.ray_slope[row, column].astype(np.float64))
    x, y = grid.x_mm - centre[0], grid.y_mm - centre[1]
    away2 = x[None, :] ** 2 + y[:, None] ** 2
    inside = away2 < contact**2
    top = pose.depth_mm - pose.radius_mm
    ball = top + np.sqrt(np.where(inside, pose.radius_mm**2 - away2, np.nan))
    off = depth - ball
    line = int(np.abs(y).argmin())
    near = np.flatnonzero(np.abs(x) <= REACH * contact)
    return Effect(
        press.name,
        x[near],
        depth[line, near],
        ball[line, near],
        float(np.sqrt(np.mean(off[inside] ** 2))),
        float(np.mean(off[away2 < 0.1 * contact**2])),
    )
