"""Threads: their priority, and waiting for those that were asked to stop."""

from __future__ import annotations

import logging
import os
import sys
import threading
import time

_LOG = logging.getLogger(__name__)

STOP_S = 1.0
"""Time to wait for a thread before it is left behind."""

_left_behind: list[threading.Thread] = []


def join(thread: threading.Thread, timeout_s: float = STOP_S) -> bool:
    """Wait for a thread that was asked to stop, and return whether it has stopped.

    Otherwise it is left behind. It is a daemon thread, so a hanging driver cannot keep the program
    from ending, and it stops when its present call returns.
    """
    thread.join(timeout_s)
    if not thread.is_alive():
        return True
    _left_behind.append(thread)
    _LOG.warning("The thread %s did not stop within %s s", thread.name, timeout_s)
    return False


def join_unfinished_threads(timeout_s: float) -> bool:
    """Wait for all threads that were left behind, and return whether they have stopped.

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


class StoppableThread:
    """A thread that can be started and stopped again. What it does is :meth:`_run`.

    Parameters
    ----------
    name : str
        Name of the thread.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._thread: threading.Thread | None = None
        self._end = threading.Event()

    def start(self) -> None:
        """Start the thread."""
        if self._thread is not None and self._thread.is_alive():
            raise RuntimeError(f"{self._name} is already running")
        self._end = threading.Event()
        self._thread = threading.Thread(
            target=self._run, args=(self._end,), name=self._name, daemon=True
        )
        self._thread.start()

    def stop(self, timeout_s: float = STOP_S) -> bool:
        """Stop the thread after its present work, and return whether it has stopped."""
        self._end.set()
        thread, self._thread = self._thread, None
        return thread is None or join(thread, timeout_s)

    def _run(self, end: threading.Event) -> None:
        raise NotImplementedError


PROCESSING = 5
"""For threads that compute what is shown; the window and capture keep their priority."""
RENDERING = 10
"""For the images of the virtual sensor, which a real camera would not have to compute."""


def lower_priority(steps: int) -> None:
    """Lower the priority of the calling thread, and of threads that it starts from now on.

    Parameters
    ----------
    steps : int
        Steps of POSIX niceness; only Linux has it for single threads, other systems change
        nothing.
    """
    if sys.platform == "linux":
        thread = threading.get_native_id()
        now = os.getpriority(os.PRIO_PROCESS, thread)
        os.setpriority(os.PRIO_PROCESS, thread, min(now + steps, 19))
