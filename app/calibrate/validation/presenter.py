"""The validation step: an object of known size, measured with the saved calibration."""

from __future__ import annotations

from PySide6.QtWidgets import QWidget

from app.calibrate.maps import Panel
from app.calibrate.states import StepState
from app.calibrate.step import Parts, StepPresenter
from app.calibrate.step_data import Step
from app.calibrate.validation.panel import ValidationPanel
from app.calibrate.validation.trial import KnownObject
from app.calibrate.validation.validating import Validating
from app.sources.bench import Scene
from gelpolight_core.translation import tr


class ValidationStep(StepPresenter):
    """Shows the live image and the measured press."""

    uses_camera = True

    def __init__(self, parts: Parts) -> None:
        super().__init__(parts)
        self.form = ValidationPanel(self.step)
        self.validating = Validating(self.model, self.form, context=self.context)
        self.form.lay_wanted.connect(self.lay_wanted)
        guide = self.context.requests.guide
        self.form.help_wanted.connect(lambda: guide.emit("guide/validate", "Validate"))
        self.validating.tried.connect(self._on_tried)

    @staticmethod
    def describe() -> Step:
        """Return the data of the step."""
        return Step(
            "validation",
            tr("Validation"),
            (),
            tr(
                "Press an indenter of known size into the membrane. The calibration is validated "
                "only if the measured size is within the limits."
            ),
            "indenter",
        )

    @property
    def side(self) -> QWidget:
        """The form for the known object."""
        return self.form

    def focus(self) -> QWidget:
        """Return the Measure button."""
        return self.form.measure

    def state(self) -> StepState:
        """Return whether the saved calibration is validated."""
        return self.validating.state

    def show_bench(self, there: bool) -> None:
        """Offer the virtual bench if there is one."""
        self.form.lay.setVisible(there)
        self.validating.refresh()

    def on_bench(self, scene: Scene) -> None:
        """Fill in the object on the virtual bench."""
        self.form.show_known(KnownObject(scene.item, scene.size_mm, scene.depth_mm))

    def close(self) -> None:
        """Stop the measurement."""
        self.validating.close()

    def refresh(self) -> None:
        """Show nothing else: the form follows the model."""

    def _on_tried(self, panel: Panel) -> None:
        if self.form.isVisibleTo(self.form.parentWidget()):
            self.area.show_result(panel)
