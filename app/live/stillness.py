"""Detects whether the image is still, for a capture that waits until nothing moves."""

from __future__ import annotations

import math

from app.live.image_checks import Rgb
from gelpolight_core.session.movement import MOVING_SHARE, moving_share

# After it is released, an object shakes for a few tenths of a second.
STILL_S = 0.5
# Measured in time, because the detection may run at 2 or at 30 frames per second; but one pair of
# frames is never enough.
STILL_FRAMES = 3


class StillnessDetector:
    """Compares consecutive frames and reports when nothing has moved for a while."""

    def __init__(self, still_s: float = STILL_S) -> None:
        self._still_s = still_s
        self._before: Rgb | None = None
        self._quiet, self._since_s = 0, 0.0
        self.moving = math.nan

    def update(self, rgb: Rgb, time_s: float) -> bool:
        """Add a frame and its time; return whether all the last frames were alike."""
        before, self._before = self._before, rgb
        alike = before is not None and before.shape == rgb.shape and before.dtype == rgb.dtype
        if before is not None and alike:
            self.moving = moving_share(before, rgb)
            alike = self.moving <= MOVING_SHARE
        if not alike:
            self._quiet, self._since_s = 0, time_s
            return False
        self._quiet += 1
        return self._quiet >= STILL_FRAMES and time_s - self._since_s >= self._still_s

    @property
    def moves(self) -> bool:
        """Whether something moved between the last two frames; False without two frames."""
        return self.moving > MOVING_SHARE
