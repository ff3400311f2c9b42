"""Timers, each with what it calls."""

from __future__ import annotations

from PySide6.QtCore import QObject, Qt, QTimer

from .actions import Slot


def timer(
    owner: QObject, interval_ms: int, slot: Slot, *, once: bool = False, precise: bool = False
) -> QTimer:
    """Return a timer that calls a function in an interval, or once after it. It is not started."""
    timer_type = Qt.TimerType.PreciseTimer if precise else Qt.TimerType.CoarseTimer
    qtimer = QTimer(owner, interval=interval_ms, singleShot=once, timerType=timer_type)
    qtimer.timeout.connect(slot)
    return qtimer
