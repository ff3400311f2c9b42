"""What a soak measures, and what it concludes."""

from __future__ import annotations

import gc
import logging
import os
import threading
import time
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import numpy as np
from probes import Lateness, resident_mb
from PySide6.QtCore import QObject, QTimer
from PySide6.QtWidgets import QApplication
from scipy.stats import theilslopes

from app.services.log import Log
from app.shell.memory import give_back
from app.widgets.qt_tree import below

# What is loaded, compiled and cached late belongs to the warm-up.
WARM_UP_S = 600.0
WARM_UP_SHARE = 0.2
MOST_GROWTH_MB_PER_H = 30.0
LEAST_ALIKE = 6
LEAST_RATE = 0.9
# A message to the user that something is impossible is no error of the program.
TOLD, FAULT = " app.services.toasts: ", "fault of this program"
COUNTED = ("rss_mb", "needed_mb", "threads", "files", "widgets", "objects", "timers", "windows")


@dataclass(frozen=True, slots=True)
class Row:
    """Figures of one rest, in which nothing but the live path runs."""

    minutes: float
    emptied: bool  # sessions, runs and images that were open are put away
    rss_mb: float
    needed_mb: float  # the same, after the allocator has given back what it can
    threads: int
    files: int
    widgets: int
    objects: int
    timers: int
    windows: int
    shown_hz: float  # frames
    late_ms: float  # of the user interface: 99th percentile, at rest
    late_at_work_ms: float  # largest since the last rest
    errors: int
    warnings: int
    disk_mb: float

    def reported(self) -> str:
        """Return the row as a line of the table."""
        return " ".join(
            f"{value:>{len(field.name)}.1f}"
            if isinstance(value, float)
            else f"{value:>{len(field.name)}d}"
            for field, value in zip(fields(self), astuple(self), strict=True)
        )


HEAD = " ".join(field.name for field in fields(Row))


class LogWatch:
    """Counts what the log says; the texts of the worst are kept."""

    def __init__(self, log: Log) -> None:
        self._log, self._seen = log, 0
        self.errors: list[str] = []
        self.reported: Counter[str] = Counter()
        self.warnings: Counter[str] = Counter()

    def look(self) -> None:
        """Take what is new."""
        for record in self._log.recent.since(self._seen):
            self._seen = record.number
            if TOLD in record.text and FAULT not in record.text:
                self.reported[record.text.partition(TOLD)[2].strip()[:200]] += 1
            elif record.level >= logging.ERROR:
                self.errors.append(record.text)
            elif record.level >= logging.WARNING:
                # After the time, the level and the thread's name.
                self.warnings[record.text.partition("WARNING")[2].strip()[:200]] += 1


class Look:
    """Measures from one moment to another, while the program rests."""

    def __init__(self, shown: Callable[[], int], lateness: Lateness) -> None:
        self._count, self._lateness = shown, lateness
        self.late_at_work_ms = max(lateness.late_ms, default=0.0)
        lateness.late_ms.clear()
        self._shown, self._began_s = shown(), time.monotonic()

    def row(self, began_s: float, log: LogWatch, scratch: Path, *, emptied: bool) -> Row:
        """Return the figures since it was made."""
        shown_hz = (self._count() - self._shown) / (time.monotonic() - self._began_s)
        late_ms = float(np.percentile(self._lateness.late_ms or [0.0], 99))
        log.look()
        objects = [o for w in QApplication.topLevelWidgets() for o in below(w, QObject)]
        if emptied:
            gc.collect()  # what refers to itself only waits for that, and is no leak
        row = Row(
            (time.monotonic() - began_s) / 60.0,
            emptied,
            resident_mb(),
            needed_mb(),
            threading.active_count(),
            len(os.listdir("/proc/self/fd")),
            len(QApplication.allWidgets()),
            len(objects),
            sum(isinstance(o, QTimer) for o in objects),
            len(QApplication.topLevelWidgets()),
            shown_hz,
            late_ms,
            self.late_at_work_ms,
            len(log.errors),
            log.warnings.total(),
            disk_mb(scratch),
        )
        self._lateness.late_ms.clear()
        return row


def needed_mb() -> float:
    """Return the resident memory without what the allocator keeps of what was given back."""
    give_back()
    return resident_mb()


def disk_mb(folder: Path) -> float:
    """Return how much a folder holds."""
    return sum(p.stat().st_size for p in folder.rglob("*") if p.is_file()) / 1e6


def trend(minutes: Sequence[float], values: Sequence[float]) -> tuple[float, float, float]:
    """Return the slope per hour, and the lower and upper end of its 95 % interval."""
    slope, _, low, high = theilslopes(values, minutes, 0.95)
    return 60.0 * slope, 60.0 * low, 60.0 * high


def grown(rows: Sequence[Row], name: str) -> tuple[str, float, float]:
    """Return in words how a figure grew, the slope per hour, and its lower end."""
    values = [float(getattr(row, name)) for row in rows]
    slope, low, high = trend([row.minutes for row in rows], values)
    words = (
        f"{values[0]:.0f} after the warm-up, {values[-1]:.0f} at the end, "
        f"{slope:+.1f} per hour (95 %: {low:+.1f} to {high:+.1f})"
    )
    return words, slope, low


def thirds(values: Sequence[float]) -> tuple[float, float]:
    """Return the medians of the first and of the last third."""
    third = max(1, len(values) // 3)
    return float(np.median(values[:third])), float(np.median(values[-third:]))


def conclude(rows: Sequence[Row]) -> tuple[list[str], list[str]]:
    """Return lines of figures, and sentences for everything that is wrong."""
    if len(rows) < 4:
        return [], ["there were too few rests to say anything"]
    warm_up = min(WARM_UP_S / 60.0, WARM_UP_SHARE * rows[-1].minutes)
    warm = [row for row in rows if row.minutes >= warm_up]
    output, wrong = [], []
    for name in COUNTED:
        output.append(f"{name}: {grown(warm, name)[0]}")
    # What a person has open takes memory for as long as it is open.
    alike, which = [row for row in warm if row.emptied], "with nothing open"
    if len(alike) < LEAST_ALIKE:
        alike, which = warm, "too few with nothing open, so all"
    reported, slope, low = grown(alike, "needed_mb")
    output.append(f"needed_mb at {len(alike)} rests ({which}): {reported}")
    if low > MOST_GROWTH_MB_PER_H:
        wrong.append(f"memory grows by {slope:.0f} MB per hour, at least by {low:.0f}")
    for name in ("shown_hz", "late_ms", "late_at_work_ms"):
        first, last = thirds([getattr(row, name) for row in warm])
        output.append(f"{name}: median {first:.1f} in the first third, {last:.1f} in the last")
        if name == "shown_hz" and last < LEAST_RATE * first:
            wrong.append(f"the rate drifts: {name} from {first:.1f} to {last:.1f}")
    return output, wrong
