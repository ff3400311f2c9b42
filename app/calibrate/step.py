"""The base class of the steps of the wizard, and the page state that they give."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from PySide6.QtCore import QObject
from PySide6.QtWidgets import QWidget

from app.live.live_detection import HeldDetection
from app.sources.latest import Done
from app.sources.source import SourceFrame
from app.sources.virtual_bench import BenchScene
from gelpolight_core.base.finding import Finding, QualityTable
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.calibration.recipe import StageResults
from gelpolight_core.calibration.stage_status import StageState
from gelpolight_core.session.session import Session

from .image_area import ImageArea
from .image_panels import ImagePanel
from .page_state import (
    BEGUN,
    OPEN,
    ORDER,
    RUNNING,
    Capture,
    PageState,
    RemedyButton,
    StepDeclaration,
    StepState,
    is_done,
)
from .step_panel import StepPanel
from .wizard_model import WizardModel

NO_CAMERA = "No camera. Select one in the bar above, or import images."


class Step(QObject, StepDeclaration):
    """One step. The wizard calls it while it is open, and knows nothing else of it.

    Parameters
    ----------
    model : WizardModel
        The session, its history and its work, and what the page shows.
    area : ImageArea
        Live image or capture, results, and film strip.
    panel : StepPanel
        The side panel of most steps.

    Attributes
    ----------
    own : tuple of QWidget
        Parts of the side panel that only this step shows.
    """

    own: tuple[QWidget, ...] = ()

    def __init__(self, model: WizardModel, area: ImageArea, panel: StepPanel) -> None:
        super().__init__(area)
        self.model, self.context, self.area, self.panel = model, model.context, area, panel
        # Only those that the session has.
        self.stages = tuple(stage for stage in self.stages if stage in model.statuses)
        self.build()

    def build(self) -> None:
        """Create what only this step shows."""

    @property
    def project(self) -> CalibrationProject:
        """The session's project."""
        return self.model.project

    @property
    def session(self) -> Session:
        """The session."""
        return self.project.session

    @property
    def results(self) -> StageResults:
        """The newest result of every stage."""
        return self.project.results

    # What is shown

    @property
    def centre(self) -> QWidget:
        """The widget in the middle."""
        return self.area

    def focus(self) -> QWidget:
        """Return the widget that the user needs first."""
        return self.panel.next

    def captures(self) -> tuple[Capture, ...]:
        """Return the images of the step with their states, including the excluded ones."""
        return ()

    def state(self) -> StepState:
        """Return the state of the step, and the message about it."""
        return self.state_of(self.stages)

    def state_of(self, stages: Sequence[str]) -> StepState:
        """Return state and message of the worst of some stages.

        A step with too few images has neither failed nor passed: it is still incomplete.
        """
        if self.model.running in stages:
            return RUNNING, "Computing"
        statuses = [self.model.statuses[stage] for stage in stages]
        if not statuses:
            return "empty", ""
        worst = max(statuses, key=lambda status: ORDER.index(status.state.value))
        is_next = self.model.jobs.busy and self.model.page.step is self
        if is_next and worst.state in (StageState.STALE, StageState.WAITING):  # just captured
            return RUNNING, "Computing"
        enough = {StageState.FAIL: self.least, StageState.PASS: self.wanted}
        if 0 < self.count() < enough.get(worst.state, 0):
            return BEGUN, f"{self.count()} of {self.wanted} captured"
        return worst.state.value, worst.sentence

    def explain(self, state: str, sentence: str) -> str:
        """Return the message about the state, by default the `sentence` of the worst stage."""
        return sentence

    def count(self) -> int:
        """Return the number of usable images."""
        return sum(capture.used for capture in self.captures())

    def placed(self) -> int:
        """Return how many objects of the virtual bench were captured."""
        return len(self.session.found(self.folder))

    def is_finished(self, state: str) -> bool:
        """Return whether nothing is left to do in the step."""
        return is_done(state) and self.count() >= self.wanted

    def needs_user(self, state: str) -> bool:
        """Return whether the next step has to wait for the user of this one."""
        statuses = [self.model.statuses[stage].state.value for stage in self.stages]
        return state in OPEN and not all(is_done(stage) for stage in statuses)

    def obstacle(self) -> str:
        """Return why the next step cannot follow yet, or an empty text."""
        return ""

    def number(self) -> Finding | None:
        """Return the one figure of the step, or None without a result."""
        figures = [figure for table in self.tables() for figure in table.figures]
        # The named one, or else the first.
        return min(figures, key=lambda figure: figure.key != self.figure, default=None)

    def progress_line(self) -> str:
        """Return the number of images, and the recommended number."""
        count = self.count()
        if not self.wanted:
            return ""
        if self.wanted > 1:
            return f"{count} of {max(self.wanted, count)} captured"
        return "Captured" if count else "Not captured yet"

    def remedies(self, state: str) -> tuple[RemedyButton, ...]:
        """Return the buttons that correct what is wrong, the best first."""
        upto = self.stages[-1] if self.stages else None
        # Without images of its own, it can only wait for a computation.
        stale = not self.folder or state in (StageState.STALE.value, StageState.WAITING.value)
        if stale and not self.model.jobs.busy and self.project.stale(upto=upto):
            return (("Recompute", lambda: self.model.compute(upto)),)
        return ()

    def tables(self) -> Sequence[QualityTable]:
        """Return the quality tables of the step."""
        return [self.model.statuses[stage].quality for stage in self.stages]

    def result_panels(self) -> tuple[ImagePanel, ...]:
        """Return the images of the step's result."""
        return ()

    # Called by the wizard

    def enter(self) -> None:
        """Show the step."""
        for widget in self.own:
            widget.show()
        self.live()

    def leave(self) -> None:
        """Show another step instead."""
        self.commit()
        for widget in self.own:
            widget.hide()

    def close(self) -> None:
        """Stop all work of the step."""
        self.commit()

    def commit(self) -> None:
        """Use what is being typed."""

    def refresh(self) -> None:
        """Follow a change of the session that the page shows already."""

    def live(self) -> None:
        """Show the live image, unless it comes from another sensor."""
        self.commit()
        self.model.update_page(shown="")
        fault, stream = self.model.camera.fault(ask=False), self.model.live.stream
        self.area.show_stream(None if fault else stream)
        if fault or stream is None:
            self.area.view.image.show_message(fault or NO_CAMERA)
        self.model.show_live("" if stream else NO_CAMERA, ready=stream is not None)
        self.model.live_detection.set_detector(None)

    def camera_changed(self) -> None:
        """Show the images of another camera."""
        self.live()

    def show_capture(self, name: str) -> None:
        """Show a capture.

        Raises
        ------
        InputError
            If it cannot be read.
        """

    def capture(self) -> None:
        """Capture an image, or return from a shown capture to the live image."""
        if self.model.page.shown:
            self.live()

    def captured(self, name: str) -> None:
        """Note that the step has a new image."""

    def repeat(self, name: str) -> None:
        """Exclude a capture, and capture it again."""

    def choose_files(self) -> None:
        """Let the user choose image files to import."""

    def exclude(self, name: str, excluded: bool) -> None:
        """Exclude an image, or include it again."""
        self.model.exclude(self.stages[0], name, excluded)

    def detected(self, done: Done[SourceFrame, HeldDetection | None]) -> None:
        """Show the detection in a live image."""

    def moved(self, handle: str, u: float, v: float, radius_px: float) -> None:
        """Correct a detection: the user has dragged a handle."""

    def on_bench(self, scene: BenchScene) -> None:
        """Use the known size of an object that was placed on the virtual bench."""


def states_of(steps: Sequence[Step]) -> dict[str, StepState]:
    """Return state and message of every step. A waiting step names the one it waits for."""
    states: dict[str, StepState] = {}
    first_open = ""
    for step in steps:
        state, text = step.state()
        empty = state == StageState.EMPTY.value and not step.folder and bool(step.stages)
        if first_open and (empty or state == StageState.WAITING.value):
            text = f"Waiting for {first_open}. Complete that step first."
        if not first_open and step.folder and step.needs_user(state):
            first_open = step.title
        states[step.key] = state, text
    return states


def resolve_page(now: PageState, steps: Sequence[Step], step: Step) -> PageState:
    """Return the page state for the present results, during a computation partly the last ones."""
    states = states_of(steps)
    state, sentence = states[step.key]
    page = replace(
        now,
        states=states,
        state=state,
        captures=step.captures(),
        number=step.number(),
        below=step.progress_line(),
        panels=step.result_panels(),
    )
    if state == RUNNING:
        return replace(page, sentence="", remedies=())
    return replace(
        page,
        sentence=step.explain(state, sentence),
        tables=step.tables(),
        remedies=step.remedies(state),
        finished=step.is_finished(state),
    )
