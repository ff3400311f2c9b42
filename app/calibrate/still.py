"""Is the picture still? For a capture that waits until nothing moves."""

from __future__ import annotations

import math

from app.live.picture_checks import Rgb
from gelpolight_core.session.movement import MOVING_SHARE, moving_share

# Half a second at 30 frames/s: a hand that lets go shakes for a few tenths.
STILL_FRAMES = 15


class Still:
    """Watches consecutive frames and says when nothing has moved for a while."""

    def __init__(self, frames: int = STILL_FRAMES) -> None:
        self._needed = frames
        self._before: Rgb | None = None
        self._quiet = 0
        self.moving = math.nan

    def update(self, rgb: Rgb) -> bool:
        """Take in the next frame; return whether the last ones were all alike."""
        before, self._before = self._before, rgb
        if before is None or before.shape != rgb.shape or before.dtype != rgb.dtype:
            self._quiet = 0
            return False
        self.moving = moving_share(before, rgb)
        self._quiet = self._quiet + 1 if self.moving <= MOVING_SHARE else 0
        return self._quiet >= self._needed

    @property
    def moves(self) -> bool:
        """Whether something moved between the last two frames; not where there are none."""
        return self.moving > MOVING_SHARE
