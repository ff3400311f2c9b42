"""A slot for one item between two threads: a newer item replaces an older one."""

from __future__ import annotations

import threading
from typing import Generic, TypeVar

T = TypeVar("T")


class Mailbox(Generic[T]):
    """Holds the newest item until it is taken; it is not a queue and cannot overflow."""

    def __init__(self) -> None:
        self._filled = threading.Condition()
        self._item: T | None = None

    def put(self, item: T) -> None:
        """Store an item in place of an older one."""
        with self._filled:
            self._item = item
            self._filled.notify()

    def take(self, timeout_s: float = 0.0) -> T | None:
        """Return and remove the item, waiting for it if necessary; None if none arrives in time."""
        with self._filled:
            if self._item is None and timeout_s > 0.0:
                self._filled.wait_for(lambda: self._item is not None, timeout_s)
            item, self._item = self._item, None
        return item
