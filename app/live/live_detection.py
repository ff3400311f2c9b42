"""A detector on the live images, with a check whether anything moves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from PySide6.QtCore import QObject

from app.live.image_checks import Rgb
from app.live.session import LiveSession
from app.live.stillness import StillnessDetector
from app.sources.source import Frame


@dataclass(frozen=True, slots=True)
class Seen:
    """What the detector found in a live frame, whether it is still, and whether anything moved.

    `moved` counts from the last :meth:`LiveDetection.forget_movement`.
    """

    detection: Any
    still: bool
    moved: bool


class _Movement:
    """Whether the images are still, and have moved. Updated by the processing thread.

    Attributes
    ----------
    moved : bool
        Whether something has moved since this was set to False.
    """

    def __init__(self) -> None:
        self.moved = False
        self.restart()

    def restart(self) -> None:
        """Begin again with another camera."""
        self._still = StillnessDetector()

    def update(self, frame: Frame) -> bool:
        """Return whether the images are still."""
        quiet = self._still.update(frame.rgb, frame.time_s)
        self.moved = self.moved or self._still.moves
        return quiet


class LiveDetection(QObject):
    """Lets a session run a detector. The values of its outcomes are `Seen`, or None.

    Parameters
    ----------
    live : LiveSession
        Runs the detector, and owns this object.
    """

    def __init__(self, live: LiveSession) -> None:
        super().__init__(live)
        self._live, self._movement = live, _Movement()
        live.switched.connect(self._restart)

    def set_detector(self, detect: Callable[[Rgb], Any] | None) -> None:
        """Use a detector from the next frame on. None: no detector."""
        # The processing thread must not hold a QObject: after a slow frame it would be the last one
        # that does, and would delete it outside the GUI thread.
        movement = self._movement

        def detect_frame(frame: Frame) -> Seen | None:
            # Always checked, so that no movement is missed while the detector changes.
            quiet = movement.update(frame)
            return None if detect is None else Seen(detect(frame.rgb), quiet, movement.moved)

        self._live.process(detect_frame)

    def forget_movement(self) -> None:
        """Reset the movement check: only movements from now on count."""
        self._movement.moved = False

    def _restart(self) -> None:
        self._movement.restart()
