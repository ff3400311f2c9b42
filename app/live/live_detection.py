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


class LiveDetection(QObject):
    """Lets a session run a detector. The values of its outcomes are `Seen`, or None.

    Parameters
    ----------
    live : LiveSession
        Runs the detector, and owns this object.
    """

    def __init__(self, live: LiveSession) -> None:
        super().__init__(live)
        self._live = live
        self._still, self._moved = StillnessDetector(), False
        live.switched.connect(self._restart)

    def set_detector(self, detect: Callable[[Rgb], Any] | None) -> None:
        """Use a detector from the next frame on. None: no detector."""

        def detect_frame(frame: Frame) -> Seen | None:
            # Always checked, so that no movement is missed while the detector changes.
            quiet = self._still.update(frame.rgb, frame.time_s)
            self._moved = self._moved or self._still.moves
            return None if detect is None else Seen(detect(frame.rgb), quiet, self._moved)

        self._live.process(detect_frame)

    def forget_movement(self) -> None:
        """Reset the movement check: only movements from now on count."""
        self._moved = False

    def _restart(self) -> None:
        self._still = StillnessDetector()
