"""Thread priorities for a busy processor: first the window, then capture, then computation."""

from __future__ import annotations

import os
import sys
import threading

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
