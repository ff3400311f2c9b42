"""The capture thread: reads every frame of a source and passes it on."""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field

from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.image.change_detection import NEVER_S

from .latest import Mailbox
from .source import Source, SourceFrame, SourceLost, SourceUnavailable
from .stoppable_thread import StoppableThread

_LOG = logging.getLogger(__name__)

SILENCE_S = 5.0
"""A source without frames for this long, after it has delivered some, counts as lost."""

MOST_SEEN = 16
"""Frames that a capture averages at the most, and may take from those already seen."""

Tap = Callable[[SourceFrame], object]


@dataclass(frozen=True, slots=True)
class StreamFigures:
    """Statistics of a stream.

    Attributes
    ----------
    rate_hz : float
        Frames received per second, over the last two seconds.
    dropped : int
        Frames that the source made since it was opened and that did not arrive.
    lost : str or None
        Why there are no frames, as a sentence; None if frames arrive, also after a lost source
        is back.
    """

    rate_hz: float = 0.0
    dropped: int = 0
    lost: str | None = None


@dataclass(slots=True)
class _CaptureRequest:
    count: int
    since_s: float
    future: Future[list[SourceFrame]]
    frames: list[SourceFrame] = field(default_factory=list)


class Stream(StoppableThread):
    """Frames of a source, read by a separate thread, which also opens and closes the source.

    Parameters
    ----------
    source : Source
        Need not be open. The stream owns it from now on.
    keeps_seen : bool, optional
        Whether to keep the last `MOST_SEEN` settled frames for captures.

    Attributes
    ----------
    source : Source
        The source; any thread may use its settings.
    newest : Mailbox of SourceFrame
        The newest frame, for one reader; further readers add the `put` of their own mailbox as a
        tap.
    """

    def __init__(self, source: Source, *, keeps_seen: bool = False) -> None:
        super().__init__(f"capture {source.name}")
        self.source = source
        self._seen: deque[SourceFrame] = deque(maxlen=MOST_SEEN * keeps_seen)
        self.newest: Mailbox[SourceFrame] = Mailbox()
        self._lock = threading.Lock()
        self._taps: list[Tap] = []
        self._captures: list[_CaptureRequest] = []
        self._restart()

    def start(self) -> None:
        """Start capturing, with all counts at 0."""
        self._restart()
        super().start()

    def add_tap(self, tap: Tap) -> None:
        """Pass every frame to `tap`, in the capture thread. It must return quickly."""
        with self._lock:
            self._taps.append(tap)

    def remove_tap(self, tap: Tap) -> None:
        """Pass no more frames to `tap`, if it is connected."""
        with self._lock:
            self._taps = [other for other in self._taps if other != tap]

    def capture(
        self, count: int, still_s: tuple[float, float] = NEVER_S
    ) -> Future[list[SourceFrame]]:
        """Collect settled frames: the newest of those already seen, then those made from now on.

        Parameters
        ----------
        count : int
            Number of frames.
        still_s : (float, float), optional
            Times from and to which seen frames show what is to be captured. Default: none does.

        Returns
        -------
        Future of list of Frame
            Fails with SourceLost if the stream ends before it is complete.
        """
        if count < 1:
            raise ValueError(f"cannot capture {count} frames")
        request = _CaptureRequest(count, time.monotonic(), Future())
        with self._lock:
            if self._thread is not None and self._lost is None and not self._end.is_set():
                seen = [f for f in self._seen if still_s[0] <= f.time_s <= still_s[1]]
                request.frames += seen[-count:]
                if len(request.frames) == count:
                    request.future.set_result(request.frames)
                else:
                    self._captures.append(request)
                return request.future
            reason = self._lost
        request.future.set_exception(reason or self._stopped())
        return request.future

    def figures(self) -> StreamFigures:
        """Return the statistics of the stream."""
        now = time.monotonic()
        with self._lock:
            times = [t for t in self._times if now - t < 2.0]
            rate = (len(times) - 1) / (times[-1] - times[0]) if len(times) > 1 else 0.0
            lost = None if self._lost is None else str(self._lost)
            return StreamFigures(rate, self._last_number + 1 - self._received, lost)

    def _restart(self) -> None:
        with self._lock:
            self._times: deque[float] = deque(maxlen=1000)
            self._last_number = -1
            self._received = 0
            self._lost: InputError | None = None
            self._seen.clear()

    def _run(self, end: threading.Event) -> None:
        lost: InputError | None = None
        try:
            self.source.open()
            self._deliver(end)
        except InputError as error:
            lost = error
        except Exception as error:
            _LOG.exception("The source %s failed", self.source.name)
            lost = SourceLost(
                f"an internal error ({type(error).__name__}) stopped the images; see the log",
                self.source.name,
                Remedy.OPEN_AGAIN,
            )
        finally:
            self.source.close()
            self._end_captures(lost, end)

    def _deliver(self, end: threading.Event) -> None:
        heard_s: float | None = None
        while not end.is_set():
            try:
                frame = self.source.frame(0.1)
            except SourceUnavailable as error:
                heard_s = None
                self._end_captures(error)
                continue
            now = time.monotonic()
            if frame is not None:
                heard_s = now
                self._hand_on(frame)
            elif heard_s is not None and now - heard_s > SILENCE_S:
                raise SourceLost(
                    f"no image has arrived for {SILENCE_S:.0f} seconds",
                    self.source.name,
                    Remedy.CHECK_CABLE,
                )

    def _hand_on(self, frame: SourceFrame) -> None:
        self.newest.put(frame)
        with self._lock:
            self._lost = None
            self._times.append(time.monotonic())
            self._last_number = max(self._last_number, frame.number)
            self._received += 1
            if not frame.settled:
                self._seen.clear()  # they show what is being changed
            else:
                self._seen.append(frame)
            taps, captures = tuple(self._taps), tuple(self._captures)
        for tap in taps:
            try:
                tap(frame)
            except Exception:
                # An error in one reader must not stop the frames for all others.
                _LOG.exception("A reader of %s failed and gets no more frames", self.source.name)
                self.remove_tap(tap)
        for capture in captures:
            self._collect(capture, frame)

    def _collect(self, capture: _CaptureRequest, frame: SourceFrame) -> None:
        if frame.settled and frame.time_s > capture.since_s:
            capture.frames.append(frame)
        if len(capture.frames) == capture.count:
            with self._lock:
                self._captures.remove(capture)
            capture.future.set_result(capture.frames)

    def _end_captures(self, lost: InputError | None, end: threading.Event | None = None) -> None:
        """Note why there are no frames, and end the captures, whose frames may never arrive."""
        with self._lock:
            if lost is not None:
                self._lost = lost.with_traceback(None)  # it is kept, and must not hold references
            if end is not None:
                end.set()
            captures, self._captures = self._captures, []
        for capture in captures:
            capture.future.set_exception(lost or self._stopped())

    def _stopped(self) -> SourceLost:
        return SourceLost("the images were stopped", self.source.name, Remedy.OPEN_AGAIN)
