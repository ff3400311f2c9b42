"""Run independent tasks on all cores, with results in order."""

from __future__ import annotations

import os
from collections.abc import Callable, Generator, Iterable
from concurrent.futures import ThreadPoolExecutor
from typing import TypeVar

ItemT = TypeVar("ItemT")
ResultT = TypeVar("ResultT")


def usable_cores() -> int:
    """Return how many cores this process may use."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def in_parallel(
    function: Callable[[ItemT], ResultT], items: Iterable[ItemT]
) -> Generator[ResultT, None, None]:
    """Yield ``function(item)`` for each item, in the order of the items.

    Each task runs in one thread from start to end, so the results do not depend on the number of
    threads. This is faster where NumPy, OpenCV or compiled loops do most of the work. A caller that
    may stop early closes it: its threads end then.

    Parameters
    ----------
    function : callable
        Called from several threads at the same time.
    items : iterable
        Its arguments.
    """
    todo = list(items)
    # More threads would only cost memory: each task holds several full-size maps.
    pool = ThreadPoolExecutor(max(min(usable_cores(), 4, len(todo)), 1), "parallel")
    try:
        waiting = [pool.submit(function, item) for item in todo]
        for future in waiting:
            yield future.result()
    finally:
        pool.shutdown(cancel_futures=True)
