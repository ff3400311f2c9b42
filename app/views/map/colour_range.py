"""The depths at the ends of the colours: a few that do not jump between frames and presses."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from app.widgets.units import round_up

HEADROOM, LIMIT = 1.2, 1.25
"""Shares of a round depth, around which presses scatter: its end, and the largest depth with it.
Between them all depths have the last colour, so that a press to an end itself does not change its
colours when its rim is resolved in a frozen image."""
LEAST_MM = 0.02
"""Least depth for the upper end, so that the noise of the bare membrane is not shown as depth."""
SHRINK_BELOW = 0.4
"""A depth below this share of its end is small: the range may shrink."""
SHRINK_AFTER_S = 2.0
LOW_SHARE = 0.1
"""Negative depths have colours of their own from this share of the upper end on."""


class ColourRange:
    """The automatic range of the colours over a sequence of depth maps.

    Each end is 0, or 1, 2, 5 times a power of ten times `HEADROOM`. It grows as soon as the depth
    goes beyond its limit. It shrinks after the depth was small for `SHRINK_AFTER_S` of a press.
    Without a press it stays, so that the next press has the colours of the last one.
    """

    def __init__(self) -> None:
        self._high, self._low = RangeLimitSmoother(), RangeLimitSmoother()

    def update(self, depth_mm: NDArray[np.float32], time_s: float) -> tuple[float, float]:
        """Return the range for the next depth map.

        Parameters
        ----------
        depth_mm : (rows, columns) float32
            Positive where an object is pressed in.
        time_s : float
            Time of the frame.

        Returns
        -------
        range_mm : (low, high)
            `low` is 0 or negative: next to a press the elastomer is pushed out.
        """
        lowest, deepest = extremes_mm(depth_mm)
        pressed = deepest > LEAST_MM
        high = self._high.update(max(deepest, LEAST_MM), time_s, may_shrink=pressed)
        below = -lowest if -lowest > LOW_SHARE * high else 0.0
        low = self._low.update(below, time_s, may_shrink=pressed)
        return (-low if low > 0.0 else 0.0), high


class RangeLimitSmoother:
    """One end of a range over a sequence of frames, as a distance from 0."""

    def __init__(self) -> None:
        self._end = 0.0
        self._last_s: float | None = None
        self._restart()

    def _restart(self) -> None:
        self._small_s = self._largest = 0.0

    def update(self, value: float, time_s: float, *, may_shrink: bool = True) -> float:
        """Return the end for a frame whose largest value is this.

        Parameters
        ----------
        value : float
            Not negative.
        time_s : float
            Time of the frame. A time before the last one counts as no time.
        may_shrink : bool, optional
            Whether this frame counts towards a smaller range.
        """
        passed_s = 0.0 if self._last_s is None else max(time_s - self._last_s, 0.0)
        self._last_s = time_s
        if value >= SHRINK_BELOW * self._end:
            self._end = max(self._end, _end_for(value))
            self._restart()
        elif may_shrink:
            self._small_s += passed_s
            self._largest = max(self._largest, value)
            if self._small_s >= SHRINK_AFTER_S:
                self._end = _end_for(self._largest)
                self._restart()
        return self._end


def _end_for(value: float) -> float:
    return HEADROOM * round_up(value / LIMIT)


def extremes_mm(depth_mm: NDArray[np.float32]) -> tuple[float, float]:
    """Return the lowest and the highest depth of a map, without single outliers."""
    some = depth_mm[::8, ::8]
    some = some[np.isfinite(some)]
    if not some.size:
        return 0.0, 0.0
    low, high = (float(v) for v in np.percentile(some, (0.5, 99.9)))
    return low, high
