"""The base class of the steps of the wizard, and what they share."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from PySide6.QtCore import QObject, Signal
from PySide6.QtWidgets import QApplication, QWidget

from app.calibrate.film_strip import Capture
from app.calibrate.image_area import ImageArea
from app.calibrate.maps import Panel
from app.calibrate.model import WizardModel
from app.calibrate.states import RUNNING, StepState, is_done, step_state
from app.calibrate.step_data import Step
from app.calibrate.step_panel import Remedy, StepPanel
from app.context.context import AppContext
from app.sources.bench import Scene
from app.sources.processor import Failure, Outcome
from gelpolight_core.calibration.status import StageState
from gelpolight_core.finding import Finding, QualityTable
from gelpolight_core.translation import tr


@dataclass(frozen=True)
class Parts:
    """What all steps of one wizard share.

    Attributes
    ----------
    model : WizardModel
        The session, its history and its work.
    context : AppContext
        Context of the application.
    area : ImageArea
        Live image or capture, results, and film strip.
    panel : StepPanel
        The side panel of most steps.
    steps : tuple of Step
        All steps of the wizard.
    """

    model: WizardModel
    context: AppContext
    area: ImageArea
    panel: StepPanel
    steps: tuple[Step, ...]


class StepPresenter(QObject):
    """One step. The wizard calls it while it is open, and knows nothing else of it.

    Parameters
    ----------
    parts : Parts
        What all steps share.

    Signals
    -------
    step_wanted(str)
        Key of a step to go to.

    Attributes
    ----------
    own : tuple of QWidget
        Parts of the side panel that only this step shows.
    """

    step_wanted = Signal(str)
    step: Step
    own: tuple[QWidget, ...] = ()
    uses_camera = False

    def __init__(self, parts: Parts) -> None:
        super().__init__(parts.area)
        described = self.describe()
        self.step = next((s for s in parts.steps if s.key == described.key), described)
        self.model, self.context = parts.model, parts.context
        self.area, self.panel = parts.area, parts.panel

    @classmethod
    def describe(cls) -> Step:
        """Return the data of the step."""
        return cls.step

    # What is shown

    @property
    def centre(self) -> QWidget:
        """The widget in the middle."""
        return self.area

    @property
    def guide(self) -> tuple[str, str]:
        """Page and section of the guide about the step."""
        return "guide/calibrate", self.step.title

    def focus(self) -> QWidget:
        """Return the widget that the user needs first."""
        return self.panel.next

    def captures(self) -> tuple[Capture, ...]:
        """Return the images of the step with their states, including the excluded ones."""
        return ()

    def state(self) -> StepState:
        """Return the state of the step, and the message about it."""
        statuses, running = self.model.statuses, self.model.running
        return step_state(self.step, statuses, running, count=self.count())

    def count(self) -> int:
        """Return the number of usable images."""
        return sum(capture.used for capture in self.captures())

    def is_finished(self, state: str) -> bool:
        """Return whether nothing is left to do in the step."""
        return is_done(state) and self.count() >= self.step.wanted

    def is_settled(self, state: str) -> bool:
        """Return whether the wizard may go on by itself: complete, without anything to read."""
        return self.is_finished(state) and state == StageState.PASS.value

    def obstacle(self) -> str:
        """Return why the next step cannot follow yet; empty if it can."""
        return ""

    def number(self) -> Finding | None:
        """Return the one figure of the step; None without a result."""
        figures = [figure for table in self.tables() for figure in table.figures]
        named = (figure for figure in figures if figure.key == self.step.figure)
        return next(named, figures[0] if figures else None)

    def progress_line(self) -> str:
        """Return how many images there are, and how many are wanted; nothing else says it."""
        step, count = self.step, self.count()
        if not step.wanted:
            return ""
        if step.wanted > 1:
            return tr("{n} of {m} captured").format(n=count, m=max(step.wanted, count))
        return tr("Captured") if count else tr("Not captured yet")

    def remedies(self, state: str) -> tuple[Remedy, ...]:
        """Return the buttons that mend what is wrong, the best first."""
        stages = self.step.stages
        upto = stages[-1] if stages else None
        stale = state in (StageState.STALE.value, StageState.WAITING.value)
        if stale and not self.model.jobs.busy and self.model.project.stale(upto=upto):
            return ((tr("Recompute"), lambda: self.model.compute(upto)),)
        return ()

    def tables(self) -> Sequence[QualityTable]:
        """Return the quality tables of the step."""
        return [self.model.statuses[stage].quality for stage in self.step.stages]

    def result_panels(self) -> tuple[Panel, ...]:
        """Return the images of the step's result."""
        return ()

    # Called by the wizard

    def start(self) -> None:
        """Begin, once all steps exist."""

    def enter(self) -> None:
        """Show the step."""
        for widget in self.own:
            widget.show()
        self.area.show_step(strip=self.step.stage is not None)
        self.live()

    def leave(self) -> None:
        """Show another step instead."""
        for widget in self.own:
            widget.hide()

    def close(self) -> None:
        """Stop all work of the step."""

    def refresh(self) -> None:
        """Show the present state of the session."""
        self.area.strip.show_captures(self.captures())
        self.show_state(*self.model.states[self.step.key])
        self.show_result()

    def show_result(self) -> None:
        """Show the images of the result, if there are any."""
        panels = self.result_panels()
        self.area.maps.show_panels(panels)
        self.area.show_result_button(bool(panels))

    def show_state(self, state: str, sentence: str) -> None:
        """Show the state in the side panel."""
        panel = self.panel
        panel.show_number(self.number(), self.progress_line(), waits=not is_done(state))
        if state == RUNNING:
            panel.show_running()
            return
        finished = self.is_finished(state)
        advance = finished and not panel.finished
        panel.show_state(
            state,
            sentence,
            self.tables(),
            remedies=self.remedies(state),
            finished=finished,
        )
        # Only if the focus is on the last pressed button: never interrupt a person who is typing.
        if advance and QApplication.focusWidget() in (None, panel.capture):
            panel.next.setFocus()

    def live(self) -> None:
        """Show the live image, unless it is that of another sensor."""
        self.model.show("")
        fault, stream = self.model.camera_fault(ask=False), self.model.live.stream
        self.area.show_stream(None if fault else stream)
        if fault or stream is None:
            self.area.view.image.say(fault or no_camera())
        self.panel.show_live("" if stream else no_camera(), ready=stream is not None)
        self.panel.capture.setEnabled(stream is not None)
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
        """Capture an image; if a capture is shown, return to the live image instead."""
        if self.model.shown:
            self.live()

    def captured(self, name: str) -> None:
        """Note that the step has a new image."""

    def repeat(self, name: str) -> None:
        """Exclude a capture, and capture it again."""

    def choose_files(self) -> None:
        """Let the user choose image files to import."""

    def exclude(self, name: str, excluded: bool) -> None:
        """Exclude an image, or include it again."""
        if self.step.stage is not None:
            self.model.exclude(self.step.stage, name, excluded)

    def detected(self, item: Outcome[Any] | Failure) -> None:
        """Show the detection in a live image."""

    def moved(self, handle: str, u: float, v: float, radius_px: float) -> None:
        """Correct a detection: the user has dragged a handle."""

    def on_bench(self, scene: Scene) -> None:
        """Use the known size of an object that was placed on the virtual bench."""


def no_camera() -> str:
    """Return the message that no camera is selected."""
    return tr("No camera. Select one in the bar above, or import images.")
