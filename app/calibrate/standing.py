"""How everything stands: the steps' signs, the panel's sentence, the strip, and the results."""

from __future__ import annotations

from PySide6.QtCore import QObject
from PySide6.QtWidgets import QApplication

from app.calibrate.look import read_raw
from app.calibrate.looking import Looking
from app.calibrate.maps import Panel, panels_of, refraction_panels
from app.calibrate.pictures import PICTURE, RESULT
from app.calibrate.states import BEGUN, RUNNING, is_done, step_state
from app.calibrate.steps import Step
from app.calibrate.takes import takes_of
from app.calibrate.validating import Validating
from app.calibrate.wizard_frame import WizardFrame
from gelpolight_core.calibration.inputs import Stage
from gelpolight_core.calibration.status import StageState
from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr

OPEN = (StageState.EMPTY.value, BEGUN, StageState.FAIL.value)


class Standing(QObject):
    """Shows how the session stands, whenever it has changed.

    Parameters
    ----------
    frame : WizardFrame
        The widgets.
    looking : Looking
        What is looked at in them.
    validating : Validating
        How the last step stands.
    """

    def __init__(self, frame: WizardFrame, looking: Looking, validating: Validating) -> None:
        super().__init__(frame)
        self._frame, self._looking, self._validating = frame, looking, validating
        self._controller = frame.controller
        self._statuses = self._controller.statuses()
        self._running: Stage | None = None

    def refresh(self) -> None:
        """Show how everything stands now."""
        frame, step = self._frame, self._frame.step
        self._statuses = self._controller.statuses()
        running = self._controller.running
        states = self._states(running)
        frame.step_list.show_states(states)
        self._show_state(*states[step.key])
        frame.pictures.strip.show_takes(
            takes_of(step, frame.project, self._statuses, self._controller.lens_views())
        )
        busy, saved = self._controller.jobs.busy, self._validating.saved
        frame.result.show_states(states, self._statuses, busy=busy, saved=saved)
        self._show_maps()
        if step.key == "reflectance" and frame.curves is not None:
            frame.curves.take_results()
        self._looking.refresh()

    def show_progress(self, title: str, share: float) -> None:
        """Show how the work that runs gets on."""
        self._frame.panel.show_work(title, share)
        running = self._controller.running
        if not title or running is not self._running:
            self._running = running
            self.refresh()

    def first_open_step(self) -> str:
        """Return the first step that is not complete."""
        states = self._states(None)
        pictured = (step for step in self._frame.steps if step.stage is not None)
        found = next((step.key for step in pictured if states[step.key][0] in OPEN), "")
        tried = states["validation"][0] != StageState.EMPTY.value
        last = "validation" if self._validating.saved and not tried else "result"
        return found or last

    def count(self, step: Step) -> int:
        """Return how many captures a step has in use."""
        return len(self._frame.project.session.found(step.folder)) if step.stage else 0

    def _states(self, running: Stage | None) -> dict[str, tuple[str, str]]:
        """Return state and sentence of every step; one that waits says for which."""
        states: dict[str, tuple[str, str]] = {}
        first_open = ""
        for number, step in enumerate(self._frame.steps, start=1):
            state, said = step_state(step, self._statuses, running, taken=self.count(step))
            empty = state == StageState.EMPTY.value and step.stage is None and bool(step.stages)
            if first_open and (empty or state == StageState.WAITING.value):
                said = tr("Waits for {step}: complete that first").format(step=first_open)
            if not first_open and step.stage is not None and state in OPEN:
                first_open = tr("step {n}, {title}").format(n=number, title=step.title)
            states[step.key] = state, said
        states["validation"] = self._validating.state
        return states

    def _show_state(self, state: str, sentence: str) -> None:
        frame, step = self._frame, self._frame.step
        panel, count = frame.panel, self.count(step)
        panel.show_count(count)
        if state == RUNNING:
            panel.show_running()
            return
        stages = step.stages
        stale = bool(stages) and state in (StageState.STALE.value, StageState.WAITING.value)
        offer = stale and not self._controller.jobs.busy and frame.project.stale(upto=stages[-1])
        finished = is_done(state) and count >= (step.wanted if step.stage else 0)
        advance = finished and not panel.finished
        panel.show_state(
            state,
            sentence,
            [self._statuses[stage].quality for stage in stages],
            recompute=bool(offer),
            finished=finished,
        )
        # Only from the button that was pressed last: nobody is interrupted in a field.
        if advance and QApplication.focusWidget() in (None, panel.capture):
            panel.next.setFocus()

    def _show_maps(self) -> None:
        frame = self._frame
        if frame.step.key == "refraction":
            self.show_refraction()
        elif frame.step.key != "validation":
            stage = frame.step.stages[0] if frame.step.stages else None
            panels = panels_of(stage, frame.project.results)
            frame.pictures.maps.show_panels(panels)
            frame.pictures.show_tab(RESULT, bool(panels))

    def show_refraction(self) -> None:
        """Show the press that is most oblique, or the one chosen, before and after."""
        results, pictures = self._frame.project.results, self._frame.pictures
        found = {ball.file: ball.press for ball in results.balls if ball.press is not None}
        panels: tuple[Panel, ...] = ()
        why = tr("The comparison comes with the ball presses: complete the earlier steps first.")
        if found and results.table is not None:
            name = self._looking.name
            if name not in found:
                name = max(found, key=lambda n: sum(c * c for c in found[n].pose.centre_mm))
            try:
                raw = read_raw(self._frame.project.session.folder / "balls" / name)
                panels = refraction_panels(raw, found[name], results)
            except InputError as error:
                why = str(error)
        pictures.maps.show_panels(panels, none=why)
        pictures.show_tab(RESULT, True)
        pictures.show_tab(PICTURE, False)
