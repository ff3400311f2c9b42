"""How a stage of a calibration stands, and its figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from gelpolight_core.calibration.inputs import Stage
from gelpolight_core.calibration.pipeline import judge_joint
from gelpolight_core.calibration.results import StageResults
from gelpolight_core.quality import QualityTable, Verdict
from gelpolight_core.translation import tr


class StageState(StrEnum):
    """How a stage stands."""

    EMPTY = "empty"
    WAITING = "waiting"
    STALE = "stale"
    PASS = "pass"
    WARN = "warn"
    FAIL = "fail"


@dataclass(frozen=True, slots=True)
class StageStatus:
    """How a stage stands, and why.

    Attributes
    ----------
    stage : Stage
        Which.
    state : StageState
        ``waiting``: its pictures are there, a result is not; ``stale``: there is a result, but not
        of the present pictures.
    sentence : str
        What to say to a person.
    quality : QualityTable
        The figures of the present result.
    """

    stage: Stage
    state: StageState
    sentence: str
    quality: QualityTable


def judged(stage: Stage, results: StageResults) -> StageStatus:
    """Return how a stage with a present result stands: by its figures.

    Parameters
    ----------
    stage : Stage
        Which.
    results : StageResults
        Those of the session so far.
    """
    if stage is Stage.BALLS:
        for ball in results.balls:
            if ball.fault is not None:
                return StageStatus(stage, StageState.FAIL, str(ball.fault), QualityTable())
    table = quality_of(stage, results)
    state = {
        Verdict.PASS: StageState.PASS,
        Verdict.WARN: StageState.WARN,
        Verdict.FAIL: StageState.FAIL,
    }[table.verdict]
    advice = ". ".join(table.advice)
    said = f"{advice}." if advice else tr("Everything is within its limits.")
    return StageStatus(stage, state, said, table)


def quality_of(stage: Stage, results: StageResults) -> QualityTable:
    """Return the quality table of a stage's result; an empty one where there is none.

    Parameters
    ----------
    stage, results
        As for :func:`judged`. Of the ball presses each figure is given where it is worst.
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
    if stage is Stage.JOINT and results.full is not None:
        figures += judge_joint(results.full).figures
    if stage is Stage.BALLS:
        figures += worst_figures([press.quality for press in results.presses])
    return QualityTable(tuple(figures))


def worst_figures(tables: Sequence[QualityTable]) -> list[Any]:
    """Return each figure of several tables where it is judged worst, in the tables' order."""
    order = list(Verdict)
    worst: dict[str, Any] = {}
    for table in tables:
        for figure in table.figures:
            known = worst.get(figure.key)
            if known is None or order.index(figure.verdict) > order.index(known.verdict):
                worst[figure.key] = figure
    return list(worst.values())
