"""A worker thread that processes only the newest request, for results that follow the pointer."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from app.sources.stopping import join

Request = TypeVar("Request")
Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class Finished(Generic[Request, Result]):
    """A request with its result, or with the error that it raised."""

    request: Request
    result: Result | None
    error: Exception | None


class NewestWins(Generic[Request, Result]):
    """Processes requests in a separate thread; a newer request replaces a waiting one.

    Parameters
    ----------
    function : callable
        Returns the result of a request; called in the thread.
    name : str
        Name of the thread.
    """

    def __init__(self, function: Callable[[Request], Result], *, name: str) -> None:
        self._function = function
        self._change = threading.Condition()
        self._waiting: list[Request] = []
        self._done: list[Finished[Request, Result]] = []
        self._busy = self._stopped = False
        self._thread = threading.Thread(target=self._work, name=name, daemon=True)
        self._thread.start()

    def submit(self, request: Request) -> None:
        """Submit a request; an earlier one that has not started yet is dropped."""
        with self._change:
            self._waiting[:] = [request]
            self._change.notify()

    def take(self) -> Finished[Request, Result] | None:
        """Return the newest result, once; None if there is no new one."""
        with self._change:
            return self._done.pop() if self._done else None

    @property
    def idle(self) -> bool:
        """Whether no request waits or runs, and no result was left to take."""
        with self._change:
            return not (self._waiting or self._busy or self._done)

    def stop(self, timeout_s: float = 5.0) -> bool:
        """Stop the thread after its present request; return whether it has stopped."""
        with self._change:
            self._stopped = True
            self._change.notify()
        return join(self._thread, timeout_s)

    def _work(self) -> None:
        while True:
            with self._change:
                self._busy = False
                self._change.wait_for(lambda: self._waiting or self._stopped)
                if self._stopped:
                    return
                request = self._waiting.pop()
                self._busy = True
            finished = self._run(request)
            with self._change:
                self._done[:] = [finished]
            del request, finished  # the thread would keep them until the next request

    def _run(self, request: Request) -> Finished[Request, Result]:
        try:
            return Finished(request, self._function(request), None)
        except Exception as error:  # passed to the thread that takes it, which shows or raises it
            return Finished(request, None, error)
