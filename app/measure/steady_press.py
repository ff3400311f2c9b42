"""Detects a steady press, and a press other than the frozen one."""

from __future__ import annotations

import numpy as np

from app.sources.source import SourceFrame
from gelpolight_core.image.change_detection import StillnessDetector, press_differs
from gelpolight_core.reconstruction.height_map import HeightMap

STRIDE = 12
PRESSED_MM = 0.08
"""On a calibrated sensor the bare membrane stays below a third of it."""
WATCH_S = 0.1
"""Interval of the checks: several within the time that something must be still."""


class SteadyPressDetector:
    """Watches live images, and reports once per press that it is steady.

    Attributes
    ----------
    other : bool
        Whether the held press was lifted, or another one is pressed in.
    """

    def __init__(self) -> None:
        self._stillness = StillnessDetector()
        self.restart()
        self._last_s = -np.inf
        self._held: SourceFrame | None = None
        self.other = False

    def restart(self) -> None:
        """Begin again, with another camera or after its settings changed."""
        self._stillness.restart()
        self._stillness.moved = True

    def update(self, frame: SourceFrame, heightmap: HeightMap) -> bool:
        """Process the next image with its depth. Return whether it may be frozen now."""
        if 0.0 <= frame.time_s - self._last_s < WATCH_S:
            return False
        self._last_s = frame.time_s
        if not frame.settled:  # it does not yet show the latest commands to the source
            self.restart()
            return False
        still = self._stillness.update(frame.rgb, frame.time_s)
        held = self._held
        if held is not None and not self.other:
            same = (held.rgb.shape, held.rgb.dtype) == (frame.rgb.shape, frame.rgb.dtype)
            self.other = not same or press_differs(held.rgb, frame.rgb)
        depth_mm = float(np.percentile(heightmap.depth_mm[::STRIDE, ::STRIDE], 99.5))
        if not (still and self._stillness.moved and depth_mm >= PRESSED_MM):
            return False
        self._stillness.moved = False
        return True

    def hold(self, frame: SourceFrame | None) -> None:
        """Watch whether the press of a frozen image stays. None: there is none.

        The current press is not reported before it has moved.
        """
        self._held, self.other = frame, False
        self._stillness.moved = False
