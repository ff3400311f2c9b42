"""Goes on to the next step that needs the user, after a countdown that any action stops."""

from __future__ import annotations

import time
from collections.abc import Sequence

from PySide6.QtCore import QCoreApplication, QEvent, QObject, QTimer

from app.calibrate.model import WizardModel
from app.calibrate.step import Step
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
        What the page shows, and the present work. Owner of this timer.
    panel : StepPanel
        Holds the switch.
    steps : sequence of Step
        The steps.
    """

    def __init__(self, model: WizardModel, panel: StepPanel, steps: Sequence[Step]) -> None:
        super().__init__(model, interval=TICK_MS)
        self._model, self._panel, self._steps = model, panel, steps
        application = QCoreApplication.instance()
        assert application is not None
        self._application = application
        self._was_incomplete = False
        self._moved_s = -REACTION_S
        self.timeout.connect(self._tick)

    def enter(self) -> None:
        """Note whether the open step is complete already."""
        self.stop()
        self._was_incomplete = not self._settled(self._place)

    def check(self) -> None:
        """Look whether the open step has just been completed."""
        if self._was_incomplete and self._settled(self._place):
            self._was_incomplete = False
            if self._panel.automatic.isChecked():
                self._application.installEventFilter(self)
                self._model.update_page(countdown=SECONDS)
                self.start()

    def stop(self) -> None:
        """Stay at this step."""
        super().stop()
        self._application.removeEventFilter(self)
        self._model.update_page(countdown=0)

    @property
    def just_moved(self) -> bool:
        """Whether a click now was meant for the step before."""
        return time.monotonic() - self._moved_s < REACTION_S

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Stop at any action of the user, and wait while the mouse moves."""
        if event.type() in STOPS:
            self.stop()
        elif event.type() == QEvent.Type.MouseMove:
            self._model.update_page(countdown=SECONDS)
        return super().eventFilter(watched, event)

    @property
    def _place(self) -> int:
        return self._model.page.place

    def _settled(self, place: int) -> bool:
        step = self._steps[place]
        return step.is_settled(self._model.page.states[step.key][0])

    def _tick(self) -> None:
        # The first later step that is not complete and needs the user.
        later = range(self._place + 1, len(self._steps))
        following = next((place for place in later if not self._settled(place)), None)
        left = self._model.page.countdown - 1
        if self._model.page.shown or following is None or not self._settled(self._place):
            self.stop()
        elif self._model.busy_with_images:  # one more capture is in progress
            self._model.update_page(countdown=SECONDS)
        elif left > 0:
            self._model.update_page(countdown=left)
        else:
            self._moved_s = time.monotonic()
            self._model.step_requested.emit(self._steps[following].key)
