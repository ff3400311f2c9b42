"""Is the picture still? For a capture that waits until nothing moves."""

from __future__ import annotations

import math

from app.live.picture_checks import Rgb
from gelpolight_core.session.movement import MOVING_SHARE, moving_share

# A hand that lets go shakes for a few tenths of a second.
STILL_S = 0.5
# Counted in time, as detection sees two frames a second or thirty; but never by a single pair.
STILL_FRAMES = 3


class Still:
    """Watches consecutive frames and says when nothing has moved for a while."""

    def __init__(self, still_s: float = STILL_S) -> None:
        self._still_s = still_s
        self._before: Rgb | None = None
        self._quiet, self._since_s = 0, 0.0
        self.moving = math.nan

    def update(self, rgb: Rgb, time_s: float) -> bool:
        """Take in the next frame and when it was made; return whether the last were all alike."""
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
        """Whether something moved between the last two frames; not where there are none."""
        return self.moving > MOVING_SHARE
