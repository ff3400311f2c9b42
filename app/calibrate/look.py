"""What each step looks for, in the live picture and in a capture."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from app.calibrate.detect import (
    BallSetting,
    detect_ball,
    detect_board,
    detect_mirror,
    detect_top_pose,
)
from app.calibrate.detect_light import detect_background, detect_whiteboard
from app.calibrate.detection import Detection, as_picture, or_refusal
from app.calibrate.marks import mirror_places, spot_markers, working_rim
from app.calibrate.steps import Step
from app.live.overlay import Circle, Overlay
from gelpolight_core.calibration.inputs import FOLDERS, Stage
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.calibration.results import StageResults
from gelpolight_core.errors import InputError
from gelpolight_core.lights.crosstalk import unmix
from gelpolight_core.lights.mirror import find_mirror_spots
from gelpolight_core.optics.lens_views import LensView
from gelpolight_core.optics.resampling import ResamplingTable
from gelpolight_core.session.session import Session
from gelpolight_core.session.wholeness import decode_picture
from gelpolight_core.translation import tr

Rgb = NDArray[Any]
Looker = Callable[[Rgb], Detection]
NOTHING = Detection(Overlay(), "", True)
# A contact drawn where none was found: a person moves it to its place.
FIRST_RADIUS = 0.1


def look_for(
    step: Step,
    project: CalibrationProject,
    *,
    radius_mm: float = 0.0,
    views: Mapping[str, LensView] | None = None,
    name: str = "",
) -> Looker:
    """Return the detection of a step, on its session's present results.

    Parameters
    ----------
    step : Step
        Which.
    project : CalibrationProject
        With the results of earlier stages.
    radius_mm : float, optional
        Of the ball.
    views : mapping of str to LensView, optional
        Lens views captured so far.
    name : str, optional
        The capture that is looked at; by default the live picture is.
    """
    session, results = project.session, project.results
    still = bool(name)
    match step.stage:
        case Stage.LENS:
            used = {path.name for path in session.found(step.folder)} - {name}
            found = {n: v.board for n, v in (views or {}).items() if n in used}
            others = [board for board in found.values() if board is not None]
            return partial(detect_board, board=session.checkerboard, earlier=others, patient=still)
        case Stage.TOP_POSE if results.lens is not None:
            return partial(
                detect_top_pose, board=session.top_pose, camera=results.lens.camera, patient=still
            )
        case Stage.LIGHTS:
            if still and session.decisions.spots_px:
                return partial(_placed_spots, session=session)
            return partial(detect_mirror, expected_px=_expected(results), editable=still)
        case Stage.RADIANCE:
            return partial(
                _whiteboard, table=results.table, known=_Known(session, Stage.BACKGROUND)
            )
        case Stage.BACKGROUND:
            return partial(_background, table=results.table, known=_Known(session, Stage.RADIANCE))
        case Stage.BALLS:
            return _ball_looker(project, radius_mm, name)
    return partial(_too_early, stage=step.stage)


class _Known:
    """Another stage's picture, read when it is first needed: in the thread that looks."""

    def __init__(self, session: Session, stage: Stage) -> None:
        self._files = session.found(FOLDERS[stage])
        self._rgb: Rgb | None = None

    @property
    def rgb(self) -> Rgb | None:
        if self._rgb is None and self._files:
            self._rgb, self._files = read_raw(self._files[-1]), ()
        return self._rgb


def _whiteboard(rgb: Rgb, table: ResamplingTable | None, known: _Known) -> Detection:
    return or_refusal(lambda: detect_whiteboard(rgb, table=table, background=known.rgb))


def _background(rgb: Rgb, table: ResamplingTable | None, known: _Known) -> Detection:
    return or_refusal(lambda: detect_background(rgb, table=table, whiteboard=known.rgb))


def _too_early(_rgb: Rgb, stage: Stage | None) -> Detection:
    if stage is None:
        return NOTHING
    return replace(NOTHING, sentence=tr("Complete the earlier steps first."), ready=False)


def _expected(results: StageResults) -> NDArray[np.float64] | None:
    """Return where the spots were in an earlier mirror picture."""
    if results.lens is None or results.top_pose is None or results.lights is None:
        return None
    return mirror_places(
        results.lens.camera, results.top_pose.plane, results.lights.led_positions_mm
    )


def _placed_spots(rgb: Rgb, session: Session) -> Detection:
    """Show the spots as a person has placed them, to be placed anew."""

    def look() -> Detection:
        spots = find_mirror_spots(as_picture(rgb), placed=session.decisions.spots_px)
        marks = Overlay(markers=spot_markers(spots, editable=True))
        return Detection(marks, tr("Spots placed by hand."), True, spots.quality.figures, spots)

    return or_refusal(look)


def _ball_looker(project: CalibrationProject, radius_mm: float, name: str) -> Looker:
    session, results = project.session, project.results
    if (
        results.table is None
        or results.lights is None
        or results.crosstalk is None
        or results.background is None
        or results.lens is None
    ):
        return partial(_too_early, stage=Stage.BALLS)
    crosstalk = results.crosstalk.matrix
    camera = results.lens.camera
    setting = BallSetting(
        results.table,
        results.lights.led_positions_mm,
        crosstalk,
        unmix(results.background, crosstalk),
        (camera.width, camera.height),
    )
    if not name:
        done = [press.pose.centre_mm for press in results.presses]
        return partial(detect_ball, setting=setting, radius_mm=radius_mm, earlier_mm=done)
    placed = session.decisions.balls.get(name)
    if placed is not None:
        circle = Circle(placed.u_px, placed.v_px, placed.radius_px, "good", handle="ball")
        overlay = Overlay(circles=(circle,), lines=(working_rim(results.table),))
        said = tr("The contact was placed by hand.")
        return lambda _rgb: Detection(overlay, said, True)
    return partial(_ball_in_capture, setting=setting, radius_mm=radius_mm)


def _ball_in_capture(rgb: Rgb, setting: BallSetting, radius_mm: float) -> Detection:
    found = detect_ball(rgb, setting, radius_mm=radius_mm, editable=True)
    if found.overlay.circles:
        return found
    rows, columns = rgb.shape[:2]
    circle = Circle(columns / 2.0, rows / 2.0, FIRST_RADIUS * rows, "bad", handle="ball")
    marks = replace(found.overlay, circles=(circle,))
    by_hand = tr("Leave the picture out, or drag the circle onto the contact's edge.")
    return replace(found, overlay=marks, sentence=f"{found.sentence} {by_hand}")


def read_raw(path: Path) -> Rgb:
    """Return a picture file as it is, (rows, columns, 3) uint8 or uint16 RGB.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    raw = decode_picture(path)
    if raw is None or raw.dtype not in (np.uint8, np.uint16):
        raise InputError(
            tr("the picture cannot be read"), where=str(path), advice=tr("Capture it again")
        )
    if raw.ndim == 2:
        raw = np.repeat(raw[..., None], 3, axis=2)
    return np.ascontiguousarray(raw[..., 2::-1])
