"""The processing thread: runs a function on the newest frame, again and again."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from app.sources.mailbox import Mailbox
from app.sources.source import Frame
from app.sources.stopping import PROCESSING, Worker, lower_priority
from gelpolight_core.errors import InputError, sentence_of

_LOG = logging.getLogger(__name__)


T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Outcome(Generic[T]):
    """The result of the function for a frame.

    Attributes
    ----------
    generation : int
        Generation of the function that made it.
    frame : Frame
        The frame that it belongs to.
    value : object
        Return value of the function.
    """

    generation: int
    frame: Frame
    value: T


@dataclass(frozen=True, slots=True)
class Failure:
    """A frame for which the function failed.

    Attributes
    ----------
    generation : int
        Generation of the function that failed.
    frame : Frame
        The frame on which it failed.
    sentence : str
        Error message for the user.
    """

    generation: int
    frame: Frame
    sentence: str


class Processor(Worker, Generic[T]):
    """Runs a function on the newest frame in one thread; a failure is a result, not an end.

    Parameters
    ----------
    inbox : Mailbox of Frame
        Source of frames; it must have no other reader.
    function : callable
        Frame -> value.
    outbox : Mailbox of Outcome or Failure
        Receives the results; a result of a function that was replaced meanwhile is dropped.
    name : str, optional
        Name of the thread.
    """

    def __init__(
        self,
        inbox: Mailbox[Frame],
        function: Callable[[Frame], T],
        outbox: Mailbox[Outcome[T] | Failure],
        *,
        name: str = "processing",
    ) -> None:
        super().__init__(name)
        self._inbox, self._outbox = inbox, outbox
        self._lock = threading.Lock()
        self._function, self._generation = function, 0
        self._reported = -1

    @property
    def generation(self) -> int:
        """Generation number of the function in use, from 0."""
        with self._lock:
            return self._generation

    def replace(self, function: Callable[[Frame], T]) -> int:
        """Use another function from the next frame on; return its generation."""
        with self._lock:
            self._function = function
            self._generation += 1
            return self._generation

    def _run(self, end: threading.Event) -> None:
        lower_priority(PROCESSING)
        while not end.is_set():
            frame = self._inbox.take(0.1)
            if frame is not None:
                self._process(frame, end)

    def _process(self, frame: Frame, end: threading.Event) -> None:
        with self._lock:
            function, generation = self._function, self._generation
        item = self._apply(function, generation, frame)
        if generation == self.generation and not end.is_set():
            self._outbox.put(item)

    def _apply(
        self, function: Callable[[Frame], T], generation: int, frame: Frame
    ) -> Outcome[T] | Failure:
        try:
            return Outcome(generation, frame, function(frame))
        except InputError as error:
            return Failure(generation, frame, str(error))
        except Exception as error:
            # Once per function: thirty tracebacks per second would flood the log.
            if generation != self._reported:
                self._reported = generation
                _LOG.exception("Processing a frame failed")
            return Failure(generation, frame, sentence_of(error))
