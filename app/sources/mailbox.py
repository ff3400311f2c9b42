"""A place for one item between two threads: the newest wins."""

from __future__ import annotations

import threading
from typing import Generic, TypeVar

T = TypeVar("T")


class Mailbox(Generic[T]):
    """Holds the newest item until it is taken; never a queue, so it cannot run full."""

    def __init__(self) -> None:
        self._filled = threading.Condition()
        self._item: T | None = None

    def put(self, item: T) -> bool:
        """Leave an item in the place of an older one; return whether one was lost."""
        with self._filled:
            lost = self._item is not None
            self._item = item
            self._filled.notify()
        return lost

    def take(self, timeout_s: float = 0.0) -> T | None:
        """Take the item, waiting for it if need be; None if there is none in time."""
        with self._filled:
            if self._item is None and timeout_s > 0.0:
                self._filled.wait_for(lambda: self._item is not None, timeout_s)
            item, self._item = self._item, None
        return item
