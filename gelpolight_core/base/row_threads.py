"""A few threads that share the rows of an image."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from typing import Any

THREAD_NAME = "image rows"


class RowThreadPool:
    """Threads that run compiled functions over blocks of rows.

    Results do not depend on the number of threads.

    Parameters
    ----------
    count : int
        Number of threads.
    """

    def __init__(self, count: int) -> None:
        self.count = max(count, 1)
        self._pool = ThreadPoolExecutor(self.count - 1, THREAD_NAME) if self.count > 1 else None

    def run(self, rows: int, action: Callable[..., object], *arguments: Any) -> None:
        """Call ``action(first, last, *arguments)`` so that all rows are done once."""
        # More blocks than threads, so that an uneven image keeps all of them busy.
        blocks = min(4 * self.count, rows)
        if self._pool is None or blocks < 2:
            action(0, rows, *arguments)
            return
        edges = [rows * k // blocks for k in range(blocks + 1)]
        waiting = iter(list(pairwise(edges)))

        def work() -> None:
            # A list's iterator hands each block to one thread.
            for first, last in waiting:
                action(first, last, *arguments)

        others = [self._pool.submit(work) for _ in range(self.count - 1)]
        work()
        for other in others:
            # A thread that has not started by now finds no block left, so it need not be awaited.
            if not other.cancel():
                other.result()
