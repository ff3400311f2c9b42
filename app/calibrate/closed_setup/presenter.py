"""The set-up step of a closed sensor."""

from __future__ import annotations

from app.calibrate.closed_setup.form import ClosedForm
from app.calibrate.setup.presenter import SetupStep
from app.calibrate.states import StepState
from app.calibrate.step_data import Step
from gelpolight_core.translation import tr


class ClosedSetupStep(SetupStep):
    """Shows the form of a closed sensor."""

    form_type = ClosedForm

    @staticmethod
    def describe() -> Step:
        """Return the data of the step."""
        return Step(
            "setup",
            tr("Set-up"),
            (),
            tr("State the scale and the ball diameter. Both scale the result."),
            "complete",
        )

    def state(self) -> StepState:
        """Return that nothing is missing: a session is created with all values."""
        return "pass", tr("Stated")
