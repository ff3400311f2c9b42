"""The calibration step: all figures together, and saving."""

from __future__ import annotations

from PySide6.QtWidgets import QWidget

from app.calibrate.result.saving import Saving
from app.calibrate.result.view import ResultView
from app.calibrate.states import is_done
from app.calibrate.step import Parts, StepPresenter
from app.calibrate.step_data import Step
from gelpolight_core.calibration.inputs import Stage
from gelpolight_core.translation import tr


class ResultStep(StepPresenter):
    """Shows every stage, and saves the calibration."""

    def __init__(self, parts: Parts) -> None:
        super().__init__(parts)
        self.view = ResultView(parts.steps)
        self.view.step_wanted.connect(self.step_wanted)
        self.saving = Saving(self.model, self.view, context=self.context)

    @staticmethod
    def describe() -> Step:
        """Return the data of the step."""
        return Step(
            "result",
            tr("Calibration"),
            (Stage.JOINT,),
            tr("Check all figures together, then save the calibration."),
            "complete",
        )

    @property
    def centre(self) -> QWidget:
        """The overview."""
        return self.view

    def focus(self) -> QWidget:
        """Return the Save button."""
        return self.view.save

    def is_finished(self, state: str) -> bool:
        """Return whether the present captures are saved as a calibration."""
        return is_done(state) and bool(self.model.saved)

    def is_settled(self, state: str) -> bool:
        """Return whether the calibration is saved: the user has then read the figures."""
        return self.is_finished(state)

    def refresh(self) -> None:
        """Show the present state of every stage."""
        super().refresh()
        model = self.model
        self.view.show_states(model.states, model.statuses, busy=model.jobs.busy, saved=model.saved)
