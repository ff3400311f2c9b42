"""A worker thread that processes only the newest request, for results that follow the pointer."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from app.sources.mailbox import Mailbox
from app.sources.stopping import Worker

Request = TypeVar("Request")
Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class Finished(Generic[Request, Result]):
    """A request with its result, or with the error that it raised."""

    request: Request
    result: Result | None
    error: Exception | None


class NewestWins(Worker, Generic[Request, Result]):
    """Processes requests in a separate thread; a newer request replaces a waiting one.

    Parameters
    ----------
    function : callable
        Returns the result of a request; called in the thread.
    name : str
        Name of the thread.

    Attributes
    ----------
    idle : bool
        Whether the result of the newest request was taken.
    """

    def __init__(self, function: Callable[[Request], Result], *, name: str) -> None:
        super().__init__(name)
        self.idle = True
        self._function = function
        self._newest: tuple[Request] | None = None
        self._inbox: Mailbox[tuple[Request]] = Mailbox()
        self._outbox: Mailbox[tuple[tuple[Request], Finished[Request, Result]]] = Mailbox()
        self.start()

    def submit(self, request: Request) -> None:
        """Submit a request; an earlier one that has not started yet is dropped."""
        self._newest, self.idle = (request,), False
        self._inbox.put(self._newest)

    def take(self) -> Finished[Request, Result] | None:
        """Return the newest result, once; None if there is no new one."""
        item = self._outbox.take()
        if item is None:
            return None
        if item[0] is self._newest:
            self._newest, self.idle = None, True
        return item[1]

    def _run(self, end: threading.Event) -> None:
        while not end.is_set():
            item = self._inbox.take(0.1)
            if item is not None:
                self._outbox.put((item, self._finished(*item)))

    def _finished(self, request: Request) -> Finished[Request, Result]:
        try:
            return Finished(request, self._function(request), None)
        except Exception as error:  # passed to the thread that takes it, which shows or raises it
            return Finished(request, None, error)
