"""The set-up step: what is known about the sensor, its boards and its balls."""

from __future__ import annotations

from functools import partial

from PySide6.QtWidgets import QWidget

from app.calibrate.session_camera import SetupCamera
from app.calibrate.setup_form import SetupForm
from app.calibrate.states import StepState
from app.calibrate.step import Parts, StepPresenter
from app.calibrate.step_data import Step
from gelpolight_core.session.session import Session
from gelpolight_core.set_up import judge_set_up
from gelpolight_core.translation import tr


class SetupStep(StepPresenter):
    """Shows the form, and applies it."""

    def __init__(self, parts: Parts) -> None:
        super().__init__(parts)
        self.form = SetupForm()
        self.form.accepted.connect(self._on_stated)
        self._camera = SetupCamera(self.form, context=self.context)

    step = Step(
        "setup",
        tr("Set-up"),
        ("response",),
        tr(
            "Enter what you know about the sensor, its housing and its parts. Every length "
            "here scales the result."
        ),
        "complete",
    )

    @property
    def centre(self) -> QWidget:
        """The form."""
        return self.form

    def state(self) -> StepState:
        """Return whether what is stated is usual: a session is created with all values."""
        state, text = super().state() if self.step.stages else ("pass", tr("Stated"))
        session = self.model.project.session
        unusual = judge_set_up(session.sensor) if session.in_place is None else ()
        return ("warn", unusual[0].sentence) if unusual and state == "pass" else (state, text)

    def focus(self) -> QWidget:
        """Return the first value."""
        return self.form.first

    def enter(self) -> None:
        """Show the values of the session, unless there are changes that are not applied."""
        super().enter()
        if not self.form.edited:
            self.form.show_session(self.model.project.session, new=False)

    def leave(self) -> None:
        """Warn about changes that are not applied."""
        if self.form.edited:
            text = tr(
                "The set-up changes are not applied yet. Go back to the set-up step to apply them."
            )
            self.context.toasts.show(text, "warn")

    def close(self) -> None:
        """Release the camera's signals, and warn about changes that are lost."""
        self._camera.close()
        if self.form.edited:
            self.context.toasts.show(tr("The set-up changes were not applied."), "warn")

    def _on_stated(self, stated: Session) -> None:
        project = self.model.project
        before = project.session
        self.model.correct(
            tr("Set-up"), partial(project.describe, stated), partial(project.describe, before), None
        )
        if project.session is before:
            return  # the error message is already shown
        self.form.show_session(project.session, new=False)
        text = tr("Applied. The stages that depend on these values are computed again.")
        self.panel.show_notice(text, "pass")
