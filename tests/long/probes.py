"""What the live figures are measured with."""

from __future__ import annotations

import math
import os
import time
from pathlib import Path

import numpy as np
from PySide6.QtCore import Qt, QTimer

TICK_MS = 5


class Lateness:
    """A timer of the user interface that notes how late it is."""

    def __init__(self) -> None:
        self.late_ms: list[float] = []
        self._due_s = math.nan
        self.timer = QTimer()
        self.timer.setTimerType(Qt.TimerType.PreciseTimer)
        self.timer.setSingleShot(True)
        self.timer.timeout.connect(self._note)
        self._again()

    def _again(self) -> None:
        self._due_s = time.monotonic() + 1e-3 * TICK_MS
        self.timer.start(TICK_MS)

    def _note(self) -> None:
        self.late_ms.append(max(0.0, 1e3 * (time.monotonic() - self._due_s)))
        self._again()


def resident_mb() -> float:
    """Return the memory of this process."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 1e6


def reported(name: str, values: list[float], unit: str, *, high: int = 99) -> str:
    """Return a line with the median, a high percentile and the largest of some values."""
    if not values:
        return f"{name}: nothing was measured"
    middle, upper = np.percentile(values, [50, high])
    return f"{name}: p50 {middle:.1f}, p{high} {upper:.1f}, largest {max(values):.1f} {unit}"


class Spent:
    """Wall and processor time since it was made, and how busy the machine was."""

    def __init__(self) -> None:
        self._wall_s, self._cpu_s = time.monotonic(), time.process_time()

    @property
    def wall_s(self) -> float:
        """Time that has passed."""
        return time.monotonic() - self._wall_s

    def reported(self) -> str:
        """Return a line."""
        cores = (time.process_time() - self._cpu_s) / self.wall_s
        load = ", ".join(f"{value:.1f}" for value in os.getloadavg())
        return f"processor: {cores:.2f} cores of {os.cpu_count()}; load of the machine: {load}"
