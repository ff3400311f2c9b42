"""Waits for threads that were asked to stop, and again before the program ends."""

from __future__ import annotations

import logging
import threading
import time

_LOG = logging.getLogger(__name__)

STOP_S = 1.0
"""Time to wait for a thread before it is left behind."""

_left_behind: list[threading.Thread] = []


def join(thread: threading.Thread, timeout_s: float = STOP_S) -> bool:
    """Wait for a thread that was asked to stop; return whether it has stopped.

    Otherwise it is left behind. It is a daemon thread, so a hanging driver cannot keep the program
    from ending, and it stops when its present call returns.
    """
    thread.join(timeout_s)
    if not thread.is_alive():
        return True
    _left_behind.append(thread)
    _LOG.warning("The thread %s did not stop within %s s", thread.name, timeout_s)
    return False


def join_left_behind(timeout_s: float) -> bool:
    """Wait for all threads that were left behind; return whether they have stopped.

    While one is running the interpreter must not shut down: a native library thread that then
    returns would abort the process.
    """
    end = time.monotonic() + timeout_s
    for thread in _left_behind:
        thread.join(max(0.0, end - time.monotonic()))
    _left_behind[:] = [thread for thread in _left_behind if thread.is_alive()]
    for thread in _left_behind:
        _LOG.error("The thread %s is still busy at the end of the program", thread.name)
    return not _left_behind
