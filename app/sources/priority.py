"""Who goes first where the processor is short: the window, then capture, then what is computed."""

from __future__ import annotations

import os
import sys
import threading

PROCESSING = 5
"""Of threads that make what is shown; the window and capture give way to nothing."""
RENDERING = 10
"""Of the virtual sensor's pictures, which no camera would have to compute."""


def give_way(steps: int) -> None:
    """Lower the priority of the calling thread, and of those that it starts from now on.

    Parameters
    ----------
    steps : int
        Of POSIX niceness; elsewhere than on Linux a thread has none of its own, and nothing is
        changed.
    """
    if sys.platform == "linux":
        thread = threading.get_native_id()
        now = os.getpriority(os.PRIO_PROCESS, thread)
        os.setpriority(os.PRIO_PROCESS, thread, min(now + steps, 19))
