"""The status of a calibration stage."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum

from gelpolight_core.base.finding import QualityTable, Verdict


class StageState(StrEnum):
    """How far a stage is, from missing images to its judged result."""

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
    state : StageState
        ``waiting``: the images exist, but no result; ``stale``: there is a result, but not for the
        present images.
    sentence : str
        Message for the user.
    quality : QualityTable
        The figures of the present result.
    """

    state: StageState
    sentence: str
    quality: QualityTable = field(default_factory=QualityTable)


def judged_by(table: QualityTable, *, cause: str = "") -> StageStatus:
    """Return the status of a stage by the figures of its up-to-date result.

    Parameters
    ----------
    table : QualityTable
        The figures.
    cause : str, optional
        From which the findings without a remedy follow.
    """
    follows = any(f.verdict is not Verdict.PASS and not f.remedy for f in table.figures)
    advice = ". ".join(((cause,) if cause and follows else ()) + table.remedies)
    sentence = f"{advice}." if advice else "Everything is within its limits."
    return StageStatus(StageState(table.verdict.value), sentence, table)
