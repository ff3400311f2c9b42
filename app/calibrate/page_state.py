"""The state of the wizard's page as one value, from which the page is drawn."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

from PySide6.QtGui import QIcon

from app.widgets.icons import icon
from gelpolight_core.base.finding import Finding, QualityTable, Verdict
from gelpolight_core.calibration.recipe import Stage
from gelpolight_core.calibration.stage_status import StageState

from .image_panels import ImagePanel

StepState = tuple[str, str]
"""State of a step, and the message about it."""

RUNNING = "running"
BEGUN = "begun"
UNRECORDED = "unrecorded"
ORDER = ("pass", "warn", "stale", "waiting", "empty", "fail")
"""States of stages, the worst last."""


STATES = {
    "empty": ("empty", "muted"),
    "waiting": ("not computed", "stale"),
    BEGUN: ("incomplete", "muted"),
    UNRECORDED: ("not recorded yet", "muted"),
    "stale": ("outdated", "stale"),
    RUNNING: ("running", "accent"),
    "pass": ("pass", "pass"),
    "warn": ("warning", "warn"),
    "fail": ("fail", "fail"),
}
"""Word and meaning of each state."""


def state_word(state: str) -> str:
    """Return the text for a state."""
    return STATES[state][0]


def state_meaning(state: str) -> str:
    """Return the meaning of a state, from which the theme derives the colour."""
    return STATES[state][1]


def state_icon(state: str) -> QIcon:
    """Return an icon for a state, whose shape shows the state without the colour."""
    return icon(f"state-{state}", state_meaning(state))


OPEN = (StageState.EMPTY.value, BEGUN, StageState.FAIL.value)
"""States in which a step still needs the user."""


UNJUDGED = (RUNNING, StageState.STALE.value, StageState.WAITING.value)
"""States in which the present captures are not judged yet."""


def is_done(state: str) -> bool:
    """Return whether a step in this state is complete."""
    return state in (StageState.PASS.value, StageState.WARN.value)


RemedyButton = tuple[str, Callable[[], object]]
"""Text of a button, and what it does."""


class StepDeclaration:
    """Texts, stages and numbers that a step of the wizard declares.

    Attributes
    ----------
    of : Stage
        The stage whose images the step captures. It gives key, title, stages and folder.
    key : str
        Short name, used in settings and scripts.
    title : str
        Text in the step list.
    stages : tuple of str
        Keys of the stages that make up the step; the first one has the images.
    folder : str
        Folder of its images; empty if it has none.
    task : str
        Instruction for the technician, in one sentence.
    assembly : str
        How the sensor is assembled in this step; a name of :mod:`app.calibrate.step_panel`.
    frames : int
        Frames averaged into one capture; 0 if none is captured in the step.
    wanted : int
        Recommended number of captures that are kept.
    least : int
        Smallest number of captures from which the stage can be computed.
    advice : str
        More about the set-up, for the help.
    button : str
        Text of the button that captures; empty for the usual one.
    figure : str
        Key of the one figure that the step shows; empty for the first one of its stages.
    guide : tuple of str
        Page of the documentation, and the anchor of the heading about the step.
    """

    of: ClassVar[Stage[Any]]
    key = title = folder = task = advice = button = figure = ""
    stages: tuple[str, ...] = ()
    assembly = "complete"
    frames = wanted = 0
    least = 1
    guide = "guide/calibrate", ""

    def __init_subclass__(cls) -> None:
        """Take over what the stage of a step says."""
        super().__init_subclass__()
        if "of" in cls.__dict__:
            of = cls.of
            cls.key, cls.title, cls.stages, cls.folder = of.key, of.title, (of.key,), of.folder


@dataclass(frozen=True, slots=True)
class Capture:
    """One captured image of a step, with its judgement.

    Attributes
    ----------
    path : Path
        Image file of the capture.
    finding : Finding or None
        How it was judged. Its value is how far it is from the result of its stage.
    note : str
        Short text below the name instead of the finding, such as ``⌀ 3 mm``.
    excluded : bool
        Whether the user excluded it.
    """

    path: Path
    finding: Finding | None = None
    note: str = ""
    excluded: bool = False

    @property
    def state(self) -> str:
        """State of the capture as of a stage, ``empty`` if it is excluded."""
        if self.excluded:
            return "empty"
        return "waiting" if self.finding is None else self.finding.verdict.value

    @property
    def used(self) -> bool:
        """Whether its stage can use it."""
        return not self.excluded and self.state != Verdict.FAIL

    @property
    def word(self) -> str:
        """The state as a text."""
        return "excluded" if self.excluded else state_word(self.state)

    @property
    def residual(self) -> float:
        """Distance from the result of the stage, or NaN if it was not compared."""
        return math.nan if self.finding is None else self.finding.value

    @property
    def caption(self) -> str:
        """Short text below the name."""
        if self.finding is None:
            return self.word
        if math.isfinite(self.residual):
            return self.note or self.finding.value_text
        return "not used" if self.finding.verdict is Verdict.FAIL else self.note or self.word


@dataclass(frozen=True, slots=True, eq=False)
class PageState:
    """State of the wizard's page, from which it is drawn.

    Attributes
    ----------
    steps : tuple of StepDeclaration
        All steps.
    step : StepDeclaration
        The open one.
    states : mapping of str to (str, str)
        State of each step and the message about it, by its key.
    state, sentence : str
        State of the open step, and the message about it.
    captures : tuple of Capture
        Images of the open step.
    shown : str
        Name of the one that is shown; empty for the live image.
    number : Finding or None
        The one figure of the open step.
    below : str
        A line about its captures.
    tables : sequence of QualityTable
        Quality tables of its stages.
    remedies : sequence of (str, callable)
        Buttons that correct what is wrong, the best first.
    finished : bool
        Whether it is complete.
    panels : tuple of ImagePanel
        Images of its result.
    notice : (str, str)
        Result of the last action, and the meaning of its colour.
    live : (str, str)
        Content of the live image, and the meaning of its colour.
    camera : bool
        Whether there is a camera.
    lost : str
        Why its images do not arrive; empty if they do.
    work : (str, float)
        Title and progress of the running work; an empty title: none.
    """

    steps: tuple[StepDeclaration, ...] = ()
    step: StepDeclaration = field(default_factory=StepDeclaration)
    states: Mapping[str, StepState] = field(default_factory=dict)
    state: str = "empty"
    sentence: str = ""
    captures: tuple[Capture, ...] = ()
    shown: str = ""
    number: Finding | None = None
    below: str = ""
    tables: Sequence[QualityTable] = ()
    remedies: Sequence[RemedyButton] = ()
    finished: bool = False
    panels: tuple[ImagePanel, ...] = ()
    notice: tuple[str, str] = ("", "")
    live: tuple[str, str] = ("", "")
    camera: bool = False
    lost: str = ""
    work: tuple[str, float] = ("", 0.0)

    @property
    def place(self) -> int:
        """Index of the open step."""
        return self.steps.index(self.step)

    @property
    def following(self) -> str:
        """Title of the next step, or an empty text."""
        return "".join(step.title for step in self.steps[self.place + 1 : self.place + 2])

    @property
    def worst_first(self) -> tuple[Capture, ...]:
        """The captures that have a residual, the worst first."""
        judged = (capture for capture in self.captures if math.isfinite(capture.residual))
        return tuple(sorted(judged, key=lambda capture: -capture.residual))
