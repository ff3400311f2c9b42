"""A detector on the live images, with a check whether anything moves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from PySide6.QtCore import QObject

from app.sources.source import SourceFrame
from gelpolight_core.base.arrays import PixelArray
from gelpolight_core.base.finding import Finding, Verdict
from gelpolight_core.image.change_detection import StillnessDetector

from .live_session import LiveSession
from .overlay import ImageOverlay


@dataclass(frozen=True, slots=True)
class Detection:
    """Detection in one frame: marks and message.

    Attributes
    ----------
    overlay : ImageOverlay
        Marks on the image.
    finding : Finding
        Message. After a failure the frame cannot be captured, a warning must be read first.
    """

    overlay: ImageOverlay
    finding: Finding

    @property
    def ready(self) -> bool:
        """Whether the frame may be captured."""
        return self.finding.verdict is not Verdict.FAIL

    @property
    def good(self) -> bool:
        """Whether the frame may be captured, and there is nothing to read first."""
        return self.finding.verdict is Verdict.PASS

    @property
    def sentence(self) -> str:
        """Message for the user: the result, or the problem with its remedy."""
        return self.finding.sentence


@dataclass(frozen=True, slots=True)
class HeldDetection:
    """Detection in a live frame, with the movement of the image.

    `held` is the share, 0..1, of the time after which an image counts as still. `moved` counts from
    the last :meth:`LiveDetection.forget_movement`.
    """

    detection: Detection
    held: float
    moved: bool

    @property
    def still(self) -> bool:
        """Whether the image is still."""
        return self.held >= 1.0


class LiveDetection(QObject):
    """Lets a session run a detector. The values of its outcomes are `HeldDetection`, or None.

    Parameters
    ----------
    live : LiveSession
        Runs the detector, and owns this object.
    """

    def __init__(self, live: LiveSession) -> None:
        super().__init__(live)
        self._live, self._movement = live, StillnessDetector()
        live.switched.connect(self._movement.restart)

    def set_detector(self, detect: Callable[[PixelArray], Detection] | None) -> None:
        """Use a detector from the next frame on. None: no detector."""
        # The processing thread must not hold a QObject: after a slow frame it would be the last one
        # that does, and would delete it outside the GUI thread.
        movement = self._movement

        def detect_frame(frame: SourceFrame) -> HeldDetection | None:
            # Always checked, so that no movement is missed while the detector changes.
            held = movement.update(frame.rgb, frame.time_s)
            return (
                None if detect is None else HeldDetection(detect(frame.rgb), held, movement.moved)
            )

        self._live.process(detect_frame)

    @property
    def still_s(self) -> tuple[float, float]:
        """Times from and to which the frames show the same as the last one."""
        return self._movement.still_s

    def count_movement(self) -> None:
        """Note that the scene is another one, even if it looks the same."""
        self._movement.moved = True

    def forget_movement(self) -> None:
        """Reset the movement check: only movements from now on count."""
        self._movement.moved = False
