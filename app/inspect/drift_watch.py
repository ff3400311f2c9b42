"""Whether the untouched sensor has moved from its calibration: looked at once a camera is there."""

from __future__ import annotations

from PySide6.QtCore import QObject, Signal

from app.inspect.products import Shown
from app.inspect.zero import drift_sentence
from app.shell.jobs import Job, Jobs
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.translation import tr


class DriftWatch(QObject):
    """Looks at one picture whenever it is told to.

    Parameters
    ----------
    jobs : Jobs
        Does the work, while it does no other.
    parent : QObject
        Owner.

    Signals
    -------
    said(str)
        How far the background has moved; empty where it has not.
    """

    said = Signal(str)

    def __init__(self, jobs: Jobs, parent: QObject) -> None:
        super().__init__(parent)
        self._jobs, self._due = jobs, False

    def again(self) -> None:
        """Look at the next picture: the camera, the calibration or how it is set is another."""
        self._due = True

    def look(self, shown: Shown, reconstructor: Reconstructor | None) -> None:
        """Take a picture that is shown, if one is due and this can tell."""
        due = self._due and shown.frame.settled and shown.heightmap is not None
        if not due or reconstructor is None or self._jobs.busy:
            return
        self._due = False
        calibration, rgb = reconstructor.calibration, shown.frame.rgb
        self._jobs.submit(
            Job(
                tr("Looking at the background"),
                lambda _: drift_sentence(rgb, calibration),
                self.said.emit,
            )
        )
