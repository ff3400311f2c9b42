"""Goes on to the next step that needs the user, as soon as the open one is complete."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from PySide6.QtCore import QTimer

from app.calibrate.model import WizardModel
from app.calibrate.step import StepPresenter
from app.calibrate.step_panel import StepPanel
from gelpolight_core.translation import tr

# Long enough to see the verdict and the figures.
LOOK_MS = 2500


class MovingOn(QTimer):
    """Waits a moment after a step was completed, then opens the next one.

    A step that was complete when it was opened stays open: the user has come back to it. A step
    with a warning stays open, too: there is something to read.

    Parameters
    ----------
    model : WizardModel
        The shown capture, the present work, and the states of all steps. Owner of this timer.
    panel : StepPanel
        Holds the switch, and shows what is complete.
    presenters : sequence of StepPresenter
        The steps.
    go_to : callable
        Opens a step by its key.
    """

    def __init__(
        self,
        model: WizardModel,
        panel: StepPanel,
        presenters: Sequence[StepPresenter],
        *,
        go_to: Callable[[str], None],
    ) -> None:
        super().__init__(model)
        self._model, self._panel, self._presenters = model, panel, presenters
        self._go_to = go_to
        self._open = presenters[0]
        self._was_incomplete = False
        self.setSingleShot(True)
        self.setInterval(LOOK_MS)
        self.timeout.connect(self._go_on)

    def enter(self, step: StepPresenter) -> None:
        """Note which step is open, and whether it is complete already."""
        self.stop()
        self._open = step
        self._was_incomplete = not self._settled

    def check(self) -> None:
        """Look whether the open step has just been completed."""
        if self._was_incomplete and self._settled:
            self._was_incomplete = False
            self.start()

    @property
    def _settled(self) -> bool:
        return self._open.is_settled(self._model.states[self._open.step.key][0])

    def _go_on(self) -> None:
        looks_back = bool(self._model.shown)
        if looks_back or not self._panel.automatic.isChecked() or not self._settled:
            return
        if self._model.busy_with_images:  # one more capture is in progress
            self.start()
            return
        following = self._next()
        if following is None:
            return
        done = self._open.step
        self._go_to(following.step.key)
        text = tr("{title} is complete. Alt+Left returns to it.").format(title=done.title)
        self._panel.show_notice(text, "pass")

    def _next(self) -> StepPresenter | None:
        """Return the first later step that is not complete and needs the user."""
        later = self._presenters[self._presenters.index(self._open) + 1 :]
        states = self._model.states
        return next(
            (
                one
                for one in later
                if not one.only_shows and not one.is_settled(states[one.step.key][0])
            ),
            None,
        )
