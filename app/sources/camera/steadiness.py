"""Watches a camera's images for some seconds and reports whether they are stable."""

from __future__ import annotations

import threading

import numpy as np
from numpy.typing import NDArray

from app.sources.source import Frame
from gelpolight_core.finding import QualityTable
from gelpolight_core.session.camera_steadiness import FRAMES, SPAN_S, band_levels, judge_steadiness


class SteadinessTest:
    """Collects the levels of frames, not the frames; its `take` is a tap of a stream.

    Parameters
    ----------
    rate_hz : float
        Nominal frame rate of the camera.
    frames : int, optional
        Least number of frames.
    span_s : float, optional
        Least duration.
    """

    def __init__(self, rate_hz: float, *, frames: int = FRAMES, span_s: float = SPAN_S) -> None:
        self._rate_hz, self._frames, self._span_s = rate_hz, frames, span_s
        self._lock = threading.Lock()
        self._levels: list[NDArray[np.float64]] = []
        self._times_s: list[float] = []
        self._before: NDArray[np.generic] | None = None
        self._repeated = 0

    def take(self, frame: Frame) -> None:
        """Add a frame; frames from before the last change of settings are skipped."""
        if not frame.settled or self.share >= 1.0:
            return
        levels = band_levels(frame.rgb)
        same = self._before is not None and np.array_equal(self._before, frame.rgb)
        self._before = frame.rgb
        with self._lock:
            self._levels.append(levels)
            self._times_s.append(frame.time_s)
            self._repeated += same

    @property
    def share(self) -> float:
        """Share of the test that is done, 0..1."""
        with self._lock:
            if len(self._times_s) < 2:
                return 0.0
            spent = self._times_s[-1] - self._times_s[0]
            return min(1.0, len(self._times_s) / self._frames, spent / max(self._span_s, 1e-9))

    def result(self) -> QualityTable:
        """Return the verdict; call it only when the share done is 1."""
        with self._lock:
            levels, times = np.stack(self._levels), np.asarray(self._times_s)
        return judge_steadiness(levels, times, rate_hz=self._rate_hz, repeated=self._repeated)
