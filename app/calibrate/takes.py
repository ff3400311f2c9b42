"""How each capture of a step fared: what the film strip shows."""

from __future__ import annotations

import math
from collections.abc import Mapping
from pathlib import Path

from app.calibrate.film_strip import Take
from app.calibrate.steps import Step
from gelpolight_core.calibration.inputs import Stage
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.calibration.status import StageState, StageStatus
from gelpolight_core.optics.lens_views import LensView
from gelpolight_core.quality import QualityTable
from gelpolight_core.translation import tr

Judgement = tuple[str, str, str]
_WAITING: Judgement = ("waiting", "", "")


def takes_of(
    step: Step,
    project: CalibrationProject,
    statuses: Mapping[Stage, StageStatus],
    views: Mapping[str, LensView],
) -> tuple[Take, ...]:
    """Return every capture of a step with its judgement, excluded ones too.

    Parameters
    ----------
    step, project
        Whose captures.
    statuses : mapping
        How every stage stands.
    views : mapping of str to LensView
        What was found in the lens views.
    """
    stage = step.stage
    if stage is None:
        return ()
    session = project.session
    used = {path.name for path in session.found(step.folder)}
    takes = []
    for path in session.captured(step.folder):
        if path.name not in used:
            takes.append(Take(path, "excluded", tr("Not used."), tr("left out")))
            continue
        state, sentence, note = _judged(stage, path, project, statuses[stage], views)
        takes.append(Take(path, state, sentence, note))
    return tuple(takes)


def _judged(
    stage: Stage,
    path: Path,
    project: CalibrationProject,
    status: StageStatus,
    views: Mapping[str, LensView],
) -> Judgement:
    match stage:
        case Stage.LENS:
            return _lens_view(views.get(path.name))
        case Stage.BALLS:
            return _ball(path.name, project)
        case _:
            if status.state in (StageState.STALE, StageState.WAITING, StageState.EMPTY):
                return _WAITING
            return status.state.value, status.sentence, ""


def _lens_view(view: LensView | None) -> Judgement:
    if view is None:
        return _WAITING
    if not view.used:
        return "fail", view.reason, tr("not used")
    if math.isnan(view.rms_px):
        return "pass", tr("Board found."), tr("board found")
    note = tr("{r:.2f} px").format(r=view.rms_px)
    return "pass", tr("Corners off by {r:.3f} px.").format(r=view.rms_px), note


def _ball(name: str, project: CalibrationProject) -> Judgement:
    for ball in project.results.balls:
        if ball.file != name:
            continue
        if ball.fault is not None:
            return "fail", str(ball.fault), tr("no ball")
        assert ball.press is not None
        quality: QualityTable = ball.press.quality
        said = ". ".join(quality.advice)
        return quality.verdict.value, said, tr("r {r:g} mm").format(r=ball.press.pose.radius_mm)
    return _WAITING
