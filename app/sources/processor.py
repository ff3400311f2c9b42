"""The processing thread: a function over the newest frame, again and again."""

from __future__ import annotations

import logging
import statistics
import threading
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from app.sources.mailbox import Mailbox
from app.sources.priority import PROCESSING, give_way
from app.sources.source import Frame
from app.sources.stopping import join
from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr

_LOG = logging.getLogger(__name__)

_POLL_S = 0.1
_KEPT_TIMES = 60

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Outcome(Generic[T]):
    """What the function made of a frame.

    Attributes
    ----------
    generation : int
        Of the function that made it.
    frame : Frame
        What it was made of.
    value : object
        What the function returned.
    """

    generation: int
    frame: Frame
    value: T


@dataclass(frozen=True, slots=True)
class Failure:
    """A frame of which the function made nothing.

    Attributes
    ----------
    generation : int
        Of the function that failed.
    frame : Frame
        What it failed on.
    sentence : str
        What people read.
    """

    generation: int
    frame: Frame
    sentence: str


@dataclass(frozen=True, slots=True)
class ProcessorFigures:
    """How a processor fares; times in ms are those of the function alone, last 60 frames."""

    rate_hz: float = 0.0
    last_ms: float = 0.0
    median_ms: float = 0.0


class Processor(Generic[T]):
    """Runs a function over the newest frame in one thread; failures are items, not ends.

    Parameters
    ----------
    inbox : Mailbox of Frame
        Where frames come from; no other reader takes from it.
    function : callable
        Frame -> value.
    outbox : Mailbox of Outcome or Failure
        Where results go; a result of a function that was replaced meanwhile is dropped.
    name : str, optional
        Of the thread.
    """

    def __init__(
        self,
        inbox: Mailbox[Frame],
        function: Callable[[Frame], T],
        outbox: Mailbox[Outcome[T] | Failure],
        *,
        name: str = "processing",
    ) -> None:
        self._inbox, self._outbox, self._name = inbox, outbox, name
        self._lock = threading.Lock()
        self._function, self._generation = function, 0
        self._reported = -1
        self._done: deque[tuple[float, float]] = deque(maxlen=_KEPT_TIMES)
        self._end = threading.Event()
        self._thread: threading.Thread | None = None

    @property
    def generation(self) -> int:
        """Number of the function in use, from 0."""
        with self._lock:
            return self._generation

    def replace(self, function: Callable[[Frame], T]) -> int:
        """Use another function from the next frame on; return its generation."""
        with self._lock:
            self._function = function
            self._generation += 1
            return self._generation

    def start(self) -> None:
        """Begin to process."""
        if self._thread is not None and self._thread.is_alive():
            raise RuntimeError("the processor runs already")
        self._end = threading.Event()
        self._thread = threading.Thread(
            target=self._run, args=(self._end,), name=self._name, daemon=True
        )
        self._thread.start()

    def stop(self) -> None:
        """End after the frame that is being processed; harmless when it is stopped."""
        self._end.set()
        if self._thread is not None:
            join(self._thread)
            self._thread = None

    def figures(self) -> ProcessorFigures:
        """Return how it fares."""
        with self._lock:
            done = tuple(self._done)
        if not done:
            return ProcessorFigures()
        spent = [ms for _, ms in done]
        span_s = done[-1][0] - done[0][0]
        rate = (len(done) - 1) / span_s if span_s > 0.0 else 0.0
        return ProcessorFigures(rate, spent[-1], statistics.median(spent))

    def _run(self, end: threading.Event) -> None:
        give_way(PROCESSING)
        while not end.is_set():
            frame = self._inbox.take(_POLL_S)
            if frame is not None:
                self._process(frame, end)

    def _process(self, frame: Frame, end: threading.Event) -> None:
        with self._lock:
            function, generation = self._function, self._generation
        began = time.perf_counter()
        item = self._apply(function, generation, frame)
        now = time.perf_counter()
        with self._lock:
            self._done.append((now, 1e3 * (now - began)))
            stale = generation != self._generation
        if not stale and not end.is_set():
            self._outbox.put(item)

    def _apply(
        self, function: Callable[[Frame], T], generation: int, frame: Frame
    ) -> Outcome[T] | Failure:
        try:
            return Outcome(generation, frame, function(frame))
        except InputError as error:
            return Failure(generation, frame, str(error))
        except Exception as error:
            # Once per function: thirty tracebacks a second would bury the log.
            if generation != self._reported:
                self._reported = generation
                _LOG.exception("Processing a frame failed")
            return Failure(
                generation,
                frame,
                tr("A fault of this program: {kind}; the log has it.").format(
                    kind=type(error).__name__
                ),
            )
