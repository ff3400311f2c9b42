"""The status of a calibration stage, and its figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from gelpolight_core.calibration.inputs import Stage
from gelpolight_core.calibration.pipeline import judge_joint
from gelpolight_core.calibration.results import StageResults, judge_balls
from gelpolight_core.finding import QualityTable, Verdict
from gelpolight_core.translation import tr


class StageState(StrEnum):
    """The state of a stage."""

    EMPTY = "empty"
    WAITING = "waiting"
    STALE = "stale"
    PASS = "pass"
    WARN = "warn"
    FAIL = "fail"


@dataclass(frozen=True, slots=True)
class StageStatus:
    """The state of a stage, and the reason.

    Attributes
    ----------
    stage : Stage
        The stage.
    state : StageState
        ``waiting``: the images exist, but no result; ``stale``: there is a result, but not for the
        present images.
    sentence : str
        Message for the user.
    quality : QualityTable
        The figures of the present result.
    """

    stage: Stage
    state: StageState
    sentence: str
    quality: QualityTable


def judged(stage: Stage, results: StageResults) -> StageStatus:
    """Return the status of a stage with an up-to-date result, judged by its figures.

    Parameters
    ----------
    stage : Stage
        The stage.
    results : StageResults
        Results of the session so far.
    """
    if stage is Stage.BALLS:
        fault = next((ball.fault for ball in results.balls if ball.fault is not None), None)
        if fault is not None and not results.presses:
            return StageStatus(stage, StageState.FAIL, str(fault), QualityTable())
    return judged_by(stage, quality_of(stage, results))


def judged_by(stage: Stage, table: QualityTable) -> StageStatus:
    """Return the status of a stage by the figures of its up-to-date result."""
    advice = ". ".join(table.remedies)
    sentence = f"{advice}." if advice else tr("Everything is within its limits.")
    return StageStatus(stage, StageState(table.verdict.value), sentence, table)


def quality_of(stage: Stage, results: StageResults) -> QualityTable:
    """Return the quality table of a stage's result; empty if there is no result.

    Parameters
    ----------
    stage, results
        As for :func:`judged`. For the ball presses, the worst value of each figure is given.
    """
    figures: list[Any] = []
    parts: tuple[Any, ...] = {
        Stage.RESPONSE: (results.response,),
        Stage.LENS: (results.lens,),
        Stage.TOP_POSE: (results.top_pose,),
        Stage.LIGHTS: (results.lights, results.crosstalk),
        Stage.RADIANCE: (results.radiance,),
        Stage.BACKGROUND: (),
        Stage.BALLS: (),
        Stage.REFLECTANCE: (results.reflectance, results.factors),
        Stage.JOINT: (),
    }[stage]
    for part in parts:
        if part is not None:
            figures += part.quality.figures
    if stage is Stage.BACKGROUND and results.bare_membrane is not None:
        figures += results.bare_membrane.figures
    if stage is Stage.JOINT and results.full is not None:
        figures += judge_joint(results, results.full).figures
    if stage is Stage.BALLS:
        figures += judge_balls(results).figures
        figures += worst_figures([press.quality for press in results.presses])
    return QualityTable(tuple(figures))


def worst_figures(tables: Sequence[QualityTable]) -> list[Any]:
    """Return the worst-judged instance of each figure of several tables, in their order."""
    order = list(Verdict)
    worst: dict[str, Any] = {}
    for table in tables:
        for figure in table.figures:
            known = worst.get(figure.key)
            if known is None or order.index(figure.verdict) > order.index(known.verdict):
                worst[figure.key] = figure
    return list(worst.values())
