"""Detects a steady press: something is pressed in, and its depth has not changed for a while."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

STRIDE = 12
PRESSED_MM = 0.08
"""On a calibrated sensor the bare membrane stays below a third of it."""
STILL_MM = 0.008
STILL_SHARE = 0.01
"""Relative to the depth: normal variation of a hand that holds still."""
STILL_S = 0.4
LEAST_FRAMES = 3


class SteadyPress:
    """Watches live depth maps, and reports once per press that it is steady."""

    def __init__(self) -> None:
        self._before: NDArray[np.float32] | None = None
        self._since_s = math.nan
        self._frames = 0
        self._armed = True

    def update(self, depth_mm: NDArray[np.float32], time_s: float, *, settled: bool = True) -> bool:
        """Process the next map. Return whether it shows a press that may be frozen now.

        Parameters
        ----------
        depth_mm : (rows, columns)
            Depth.
        time_s : float
            Time of its image.
        settled : bool, optional
            Whether the image already shows the latest commands to the source.
        """
        coarse = depth_mm[::STRIDE, ::STRIDE]
        before, self._before = self._before, coarse
        depth = float(np.percentile(coarse, 99.5))
        if before is None or before.shape != coarse.shape:
            return False
        if not settled or depth < PRESSED_MM:
            return self._moved()
        if float(np.abs(coarse - before).max()) > STILL_MM + STILL_SHARE * depth:
            return self._moved()
        self._frames += 1
        if math.isnan(self._since_s):
            self._since_s = time_s
        still = time_s - self._since_s >= STILL_S and self._frames >= LEAST_FRAMES
        if not (still and self._armed):
            return False
        self._armed = False
        return True

    def hold_off(self) -> None:
        """Do not report the current press before it has moved."""
        self._armed = False

    def _moved(self) -> bool:
        self._armed = True
        self._since_s, self._frames = math.nan, 0
        return False
