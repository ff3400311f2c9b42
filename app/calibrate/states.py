"""The state of a step or an image: text, colour and icon, the same everywhere in the wizard."""

from __future__ import annotations

from collections.abc import Mapping

from PySide6.QtGui import QIcon

from app.calibrate.step_data import Step
from app.theme.icons import icon
from gelpolight_core.calibration.status import StageState, StageStatus
from gelpolight_core.translation import tr

StepState = tuple[str, str]
"""State of a step, and the message about it."""

RUNNING = "running"
BEGUN = "begun"
_ORDER = ("pass", "warn", "stale", "waiting", "empty", "fail")


def state_word(state: str) -> str:
    """Return the text for a state."""
    return {
        "empty": tr("empty"),
        "waiting": tr("not computed"),
        BEGUN: tr("incomplete"),
        "stale": tr("outdated"),
        "running": tr("running"),
        "pass": tr("pass"),
        "warn": tr("warning"),
        "fail": tr("fail"),
    }[state]


def state_meaning(state: str) -> str:
    """Return the meaning of a state, from which the theme derives the colour."""
    names = {"empty": "muted", BEGUN: "muted", "waiting": "stale", "running": "accent"}
    return names.get(state, state)


def state_icon(state: str) -> QIcon:
    """Return an icon for a state; its shape shows the state without the colour."""
    return icon(f"state-{state}", state_meaning(state))


def step_state(
    step: Step, statuses: Mapping[str, StageStatus], running: str | None, *, count: int
) -> StepState:
    """Return state and message of a step: those of its worst stage.

    A step with too few images, `count`, has not failed: it is still incomplete.
    """
    if not step.stages:
        return "empty", ""
    if running in step.stages:
        return RUNNING, tr("Computing")
    found = [statuses[stage] for stage in step.stages]
    worst = max(found, key=lambda status: _ORDER.index(status.state.value))
    if worst.state is StageState.FAIL and 0 < count < step.least:
        return BEGUN, tr("{n} of {m} captured").format(n=count, m=step.wanted)
    return worst.state.value, worst.sentence


OPEN = (StageState.EMPTY.value, BEGUN, StageState.FAIL.value)
"""States in which a step still needs the user."""


def is_done(state: str) -> bool:
    """Return whether a step in this state is complete."""
    return state in (StageState.PASS.value, StageState.WARN.value)
