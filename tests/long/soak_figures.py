"""What a soak measures, and what it concludes."""

from __future__ import annotations

import gc
import logging
import os
import threading
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import numpy as np
from probes import resident_mb
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
LEAST_RATE = 0.9
# A message to the user that something is impossible is no error of the program.
TOLD, FAULT = " app.services.toasts: ", "fault of this program"


@dataclass(frozen=True, slots=True)
class Row:
    """Figures of one rest, in which nothing but the live path runs."""

    minutes: float
    rss_mb: float
    needed_mb: float  # the same, after the allocator has given back what it can
    threads: int
    files: int
    widgets: int
    objects: int
    timers: int
    shown_hz: float  # frames
    late_ms: float  # of the user interface: 99th percentile
    errors: int
    disk_mb: float

    def reported(self) -> str:
        """Return the row as a line of the table."""
        named = zip(fields(self), astuple(self), strict=True)
        return " ".join(f"{round(value, 1):>{len(field.name)}}" for field, value in named)


HEAD = " ".join(field.name for field in fields(Row))


class LogWatch:
    """Counts what the log says; the texts of the worst are kept."""

    def __init__(self, log: Log) -> None:
        self._log, self._seen = log, 0
        self.errors: list[str] = []
        self.others: Counter[str] = Counter()

    def look(self) -> None:
        """Take what is new."""
        for record in self._log.recent.since(self._seen):
            self._seen = record.number
            if TOLD in record.text and FAULT not in record.text:
                self.others[record.text.partition(TOLD)[2].strip()[:200]] += 1
            elif record.level >= logging.ERROR:
                self.errors.append(record.text)
            elif record.level >= logging.WARNING:
                # After the time, the level and the thread's name.
                self.others[record.text.partition("WARNING")[2].strip()[:200]] += 1


def measured(began_s: float, shown_hz: float, late: list[float], log: LogWatch, disk: Path) -> Row:
    """Return the figures of now, with what was counted over the rest."""
    log.look()
    gc.collect()  # what refers to itself only waits for that, and is no leak
    objects = [o for w in QApplication.topLevelWidgets() for o in below(w, QObject)]
    rss_mb = resident_mb()
    give_back()
    return Row(
        (time.monotonic() - began_s) / 60.0,
        rss_mb,
        resident_mb(),
        threading.active_count(),
        len(os.listdir("/proc/self/fd")),
        len(QApplication.allWidgets()),
        len(objects),
        sum(isinstance(o, QTimer) for o in objects),
        shown_hz,
        float(np.percentile(late or [0.0], 99)),
        len(log.errors),
        sum(p.stat().st_size for p in disk.rglob("*") if p.is_file()) / 1e6,
    )


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
    output = []
    for name in (field.name for field in fields(Row)[1:]):
        first, last = thirds([getattr(row, name) for row in warm])
        output.append(f"{name}: median {first:.1f} in the first third, {last:.1f} in the last")
    wrong = []
    slope, _, low, high = theilslopes(
        [row.needed_mb for row in warm], [row.minutes / 60.0 for row in warm], 0.95
    )
    if low > MOST_GROWTH_MB_PER_H:
        wrong.append(f"memory grows by {slope:.0f} MB per hour (95 %: {low:.0f} to {high:.0f})")
    first, last = thirds([row.shown_hz for row in warm])
    if last < LEAST_RATE * first:
        wrong.append(f"the rate falls from {first:.1f} to {last:.1f} frames per second")
    return output, wrong
