"""Goes on to the next step that needs the user, after a countdown that any action stops."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from PySide6.QtCore import QCoreApplication, QEvent, QObject, QTimer

from app.calibrate.model import WizardModel
from app.calibrate.step import StepPresenter
from app.calibrate.step_panel import StepPanel

# Long enough to see the verdict and the figure.
SECONDS = 3
TICK_MS = 1000
REACTION_S = 0.5
"""A click so soon after the step has changed was meant for the step before."""
STOPS = (QEvent.Type.MouseButtonPress, QEvent.Type.KeyPress, QEvent.Type.Wheel)


class MovingOn(QTimer):
    """Counts down in the Next button after a step was completed, then opens the next one.

    Any key or click stops it, and a moving mouse delays it: it never changes the page under a
    hand. A step that was complete when it was opened stays open: the user has come back to it. A
    step with a warning stays open, too: there is something to read.

    Parameters
    ----------
    model : WizardModel
        The shown capture, the present work, and the states of all steps. Owner of this timer.
    panel : StepPanel
        Holds the switch, and shows the countdown.
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
        application = QCoreApplication.instance()
        assert application is not None
        self._application = application
        self._open = presenters[0]
        self._was_incomplete = False
        self._left = 0
        self._moved_s = -REACTION_S
        self.setInterval(TICK_MS)
        self.timeout.connect(self._tick)

    def enter(self, step: StepPresenter) -> None:
        """Note which step is open, and whether it is complete already."""
        self.stop()
        self._open = step
        self._was_incomplete = not self._settled

    def check(self) -> None:
        """Look whether the open step has just been completed."""
        if self._was_incomplete and self._settled:
            self._was_incomplete = False
            if self._panel.automatic.isChecked():
                self._application.installEventFilter(self)
                self._count_from(SECONDS)
                self.start()

    def stop(self) -> None:
        """Stay at this step."""
        super().stop()
        self._application.removeEventFilter(self)
        self._panel.show_countdown(0)

    @property
    def just_moved(self) -> bool:
        """Whether a click now was meant for the step before."""
        return time.monotonic() - self._moved_s < REACTION_S

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Stop at any action of the user, and wait while the mouse moves."""
        if event.type() in STOPS:
            self.stop()
        elif event.type() == QEvent.Type.MouseMove:
            self._count_from(SECONDS)
        return super().eventFilter(watched, event)

    def _count_from(self, seconds: int) -> None:
        self._left = seconds
        self._panel.show_countdown(seconds)

    @property
    def _settled(self) -> bool:
        return self._open.is_settled(self._model.states[self._open.step.key][0])

    def _tick(self) -> None:
        looks_back, following = bool(self._model.shown), self._next()
        if looks_back or following is None or not self._settled:
            self.stop()
        elif self._model.busy_with_images:  # one more capture is in progress
            self._count_from(SECONDS)
        elif self._left > 1:
            self._count_from(self._left - 1)
        else:
            self._moved_s = time.monotonic()
            self._go_to(following.step.key)

    def _next(self) -> StepPresenter | None:
        """Return the first later step that is not complete and needs the user."""
        later = self._presenters[self._presenters.index(self._open) + 1 :]
        states = self._model.states
        return next(
            (one for one in later if not one.is_settled(states[one.step.key][0])),
            None,
        )
