"""The validation step of a closed sensor: all figures, saving, and an object of known size."""

from __future__ import annotations

from PySide6.QtWidgets import QWidget

from app.calibrate.result.saving import Saving
from app.calibrate.result.view import ResultView
from app.calibrate.step import Parts
from app.calibrate.step_data import Step
from app.calibrate.validation.presenter import ValidationStep
from gelpolight_core.translation import tr


class ClosedValidationStep(ValidationStep):
    """Shows the figures until the calibration is saved, then the live image."""

    def __init__(self, parts: Parts) -> None:
        super().__init__(parts)
        self.view = ResultView(parts.steps)
        self.view.report.hide()  # a report describes the optics of an open sensor
        self.view.step_wanted.connect(self.step_wanted)
        self._saving = Saving(self.model, self.view, context=self.context)
        self._shown = self.centre

    @staticmethod
    def describe() -> Step:
        """Return the data of the step."""
        return Step(
            "validation",
            tr("Validation"),
            (),
            tr(
                "Save the calibration. Then press an object of known size into the membrane. The "
                "calibration is validated only if the measured size is within the limits."
            ),
            "indenter",
        )

    @property
    def centre(self) -> QWidget:
        """The figures of an unsaved calibration, or the image."""
        return self.area if self.model.saved else self.view

    def focus(self) -> QWidget:
        """Return the Save or the Measure button."""
        return self.form.measure if self.model.saved else self.view.save

    def enter(self) -> None:
        """Show the step."""
        self._shown = self.centre
        super().enter()

    def refresh(self) -> None:
        """Show the present figures; a saved calibration shows the image instead."""
        model = self.model
        self.view.show_states(model.states, model.statuses, busy=model.jobs.busy, saved=model.saved)
        if self.centre is not self._shown:
            self.step_wanted.emit(self.step.key)
