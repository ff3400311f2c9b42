"""The newest frame or request: a slot between two threads, and a thread that works on it."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from gelpolight_core.base.errors import as_input_error, error_message

from .stoppable_thread import StoppableThread, lower_priority

_LOG = logging.getLogger(__name__)

ItemT = TypeVar("ItemT")
RequestT = TypeVar("RequestT")
ResultT = TypeVar("ResultT")


class Mailbox(Generic[ItemT]):
    """Holds the newest item until it is taken. It is no queue and cannot overflow."""

    def __init__(self) -> None:
        self._filled = threading.Condition()
        self._item: ItemT | None = None

    def put(self, item: ItemT) -> None:
        """Store an item in place of an older one."""
        with self._filled:
            self._item = item
            self._filled.notify()

    def take(self, timeout_s: float = 0.0) -> ItemT | None:
        """Return and remove the item, waiting for it if necessary. None: none arrived in time."""
        with self._filled:
            if self._item is None and timeout_s > 0.0:
                self._filled.wait_for(lambda: self._item is not None, timeout_s)
            item, self._item = self._item, None
        return item


@dataclass(frozen=True, slots=True)
class Done(Generic[RequestT, ResultT]):
    """A request with its result, or with a sentence for the user that says why it failed."""

    request: RequestT
    result: ResultT | None
    failure: str = ""


class Latest(StoppableThread, Generic[RequestT, ResultT]):
    """Runs a function on the newest request, and drops older ones that have not begun.

    Parameters
    ----------
    function : callable
        Request -> result; called in the thread. An error is an ordinary result.
    name : str
        Name of the thread.
    priority : int, optional
        Steps by which the priority of the thread is lowered.
    """

    def __init__(
        self, function: Callable[[RequestT], ResultT], *, name: str, priority: int = 0
    ) -> None:
        super().__init__(name)
        self._changed = threading.Condition()
        self._priority = priority
        self._newest: tuple[RequestT] | None = None
        self._waiting: tuple[RequestT] | None = None
        self.replace(function)

    @property
    def idle(self) -> bool:
        """Whether the result of the newest request was taken."""
        return self._newest is None

    def replace(self, function: Callable[[RequestT], ResultT]) -> None:
        """Use another function from the next request on, and drop the results of this one."""
        with self._changed:
            self._task = (function,)  # another tuple, even for the same function
            self._done: tuple[tuple[RequestT], Done[RequestT, ResultT]] | None = None

    def submit(self, request: RequestT) -> None:
        """Ask for the result of a request."""
        with self._changed:
            self._waiting = self._newest = (request,)
            self._changed.notify()

    def forget(self) -> None:
        """Drop the request that waits."""
        with self._changed:
            self._waiting = None

    def take(self) -> Done[RequestT, ResultT] | None:
        """Return the newest result, once. None: there is no new one."""
        with self._changed:
            done, self._done = self._done, None
            if done is None:
                return None
            if done[0] is self._newest:
                self._newest = None
            return done[1]

    def _run(self, end: threading.Event) -> None:
        if self._priority:
            lower_priority(self._priority)
        reported = None
        while not end.is_set():
            with self._changed:
                self._changed.wait_for(lambda: self._waiting is not None, 0.1)
                item, self._waiting = self._waiting, None
                task = self._task
            if item is None:
                continue
            try:
                done = Done(item[0], task[0](item[0]))
            except Exception as error:
                # Once per function: thirty tracebacks per second would flood the log.
                if as_input_error(error) is None and reported is not task:
                    reported = task
                    _LOG.exception("%s failed", self._name)
                done = Done(item[0], None, error_message(error))
            with self._changed:
                if task is self._task and not end.is_set():
                    self._done = item, done
            del item, task, done  # the thread must not keep what it has handed over
