"""From the chosen source to what is shown: one capture thread, one processing thread, one timer."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any

from PySide6.QtCore import QObject, Qt, QTimer, Signal

from app.inspect.products import Maker, Shown, Wanted, camera_picture
from app.shell.context import AppContext
from app.sources.mailbox import Mailbox
from app.sources.processor import Failure, Outcome, Processor
from app.sources.recording import RecordingSource
from app.sources.source import Frame
from app.sources.stream import Stream
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.translation import tr

TICK_MS = 8
STATUS_MS = 500
RATE_WINDOW_S = 2.0


class _Inbox:
    """The processing thread's mailbox; counts frames that it was too slow for."""

    def __init__(self) -> None:
        self.box: Mailbox[Frame] = Mailbox()
        self._lock = threading.Lock()
        self.unprocessed = 0

    def put(self, frame: Frame) -> None:
        if self.box.put(frame):
            with self._lock:
                self.unprocessed += 1


class LiveLink(QObject):
    """Keeps the source's stream and the processing while the page is shown.

    Parameters
    ----------
    show : callable
        Given each Shown, in the GUI thread.
    context : AppContext
        With the source that all pages share.
    parent : QObject
        Owner.

    Attributes
    ----------
    stream : Stream or None
        Where frames come from.
    last : Shown or None
        What was shown last.

    Signals
    -------
    switched()
        There is another stream, or none.
    said(str)
        Why nothing is shown, as a sentence; empty when all is well.
    """

    switched = Signal()
    said = Signal(str)

    def __init__(
        self, show: Callable[[Shown], object], *, context: AppContext, parent: QObject
    ) -> None:
        super().__init__(parent)
        self._show, self._context = show, context
        self.stream: Stream | None = None
        self.last: Shown | None = None
        self._page_shown = self._paused = self._resting = False
        self._sentence = ""
        self._shown_s: deque[float] = deque()
        self._maker = Maker(None)
        self._inbox = _Inbox()
        self._outbox: Mailbox[Outcome[Any] | Failure] = Mailbox()
        self._processor: Processor[Any] = Processor(
            self._inbox.box, self._maker, self._outbox, name="inspect"
        )
        self._tick, self._status = QTimer(self), QTimer(self)
        self._tick.setTimerType(Qt.TimerType.PreciseTimer)
        self._tick.setInterval(TICK_MS)
        self._tick.timeout.connect(self._take)
        self._status.setInterval(STATUS_MS)
        self._status.timeout.connect(self._tell)

    @property
    def paused(self) -> bool:
        """Whether the picture stands."""
        return self._paused

    @property
    def shown_hz(self) -> float:
        """Frames shown per second."""
        times = self._shown_s
        return (len(times) - 1) / (times[-1] - times[0]) if len(times) > 1 else 0.0

    @property
    def reconstructor(self) -> Reconstructor | None:
        """What makes depth of a standing picture, as good as it can."""
        return self._maker.best

    @property
    def live(self) -> Reconstructor | None:
        """What makes depth of moving pictures."""
        return self._maker.live

    @property
    def serial(self) -> str:
        """Serial of the sensor that the source is known to be; empty where it is not known."""
        choice = self._context.source
        if choice.info is None or self.stream is None:
            return ""
        if choice.info.kind == "virtual" and choice.bench is not None:
            return choice.bench.design.serial
        source = self.stream.source
        if isinstance(source, RecordingSource) and source.header is not None:
            return source.header.serial
        return ""

    def use(self, live: Reconstructor | None, best: Reconstructor | None = None) -> None:
        """Reconstruct with these from now on; what is under way is dropped."""
        wanted, self._maker = self._maker.wanted, Maker(live, best)
        self._maker.wanted = wanted
        self._processor.replace(self._maker)
        if self.last is not None:
            self.last = Shown(self.last.frame)  # its depth is of the calibration before
        self._again()

    def want(self, wanted: Wanted) -> None:
        """Make something else of the frames; a standing picture is made anew."""
        if wanted != self._maker.wanted:
            self._maker.wanted = wanted
            self._again()

    def pause(self, on: bool) -> None:
        """Let the picture stand, or go on."""
        if on == self._paused:
            return
        self._paused = on
        if self.stream is not None:
            (self.stream.remove_tap if on else self.stream.add_tap)(self._inbox.put)
        self._inbox.box.take()

    def rest(self, on: bool) -> None:
        """Process nothing for a while; the thread of another has the reconstructor then."""
        if self.stream is None or on == self._resting:
            return
        self._resting = on
        if on:
            self._processor.stop()
        else:
            self._processor.start()

    def enter(self, shown: bool) -> None:
        """Follow the page: whether it is shown."""
        self._page_shown = shown
        self.open()

    def open(self) -> None:
        """Take frames of the chosen source from now on, while the page is shown."""
        self.close()
        info = self._context.source.info
        if info is not None and self._page_shown:
            self._inbox.unprocessed = 0
            self.stream = Stream(info.open())
            if not self._paused:
                self.stream.add_tap(self._inbox.put)
            self.stream.start()
            self._processor.start()
            self._tick.start()
            self._status.start()
            self._context.status.update(camera=info.name)
        self.switched.emit()

    def close(self) -> None:
        """Let the source go."""
        self._tick.stop()
        self._status.stop()
        if self.stream is not None:
            self.stream.remove_tap(self._inbox.put)
            self._processor.stop()
            self._resting = False
            self.stream.stop()
            self.stream = None
        self.last = None
        self._inbox.box.take()
        self._outbox.take()
        self._shown_s.clear()
        self._say("")
        self._context.status.update(camera=None, rate_hz=None, dropped=None, processing_ms=None)

    def _again(self) -> None:
        if self._paused and self.last is not None:
            self._inbox.box.put(self.last.frame)

    def _take(self) -> None:
        item = self._outbox.take()
        if item is None or item.generation != self._processor.generation:
            return
        if isinstance(item, Failure):
            self._say(item.sentence)
            self._show(Shown(item.frame, camera=camera_picture(item.frame, self._maker.wanted)))
            return
        self._say("")
        self.last = item.value
        now = time.monotonic()
        self._shown_s.append(now)
        while now - self._shown_s[0] > RATE_WINDOW_S:
            self._shown_s.popleft()
        self._show(item.value)

    def _tell(self) -> None:
        if self.stream is None:
            return
        figures = self.stream.figures()
        self._context.status.update(
            rate_hz=figures.rate_hz,
            dropped=figures.dropped + self._inbox.unprocessed,
            processing_ms=(self.last.total_ms or None) if self.last is not None else None,
        )
        if figures.lost:
            self._say(figures.lost)

    def _say(self, sentence: str) -> None:
        if sentence != self._sentence:
            self._sentence = sentence
            self.said.emit(sentence)

    def words(self) -> str:
        """Return how it fares, for people."""
        if self.last is None or self.last.heightmap is None:
            return ""
        words = tr("{hz:.0f} shown/s, {ms:.0f} ms").format(hz=self.shown_hz, ms=self.last.total_ms)
        plan = self.last.heightmap.plan
        how = (
            self.last.heightmap.model if plan is None else f"{plan.effort}, {len(plan.done)} steps"
        )
        return f"{words}, {how}"

    def plan_words(self) -> str:
        """Return which steps the frame shown needed, one a line."""
        if self.last is None or self.last.heightmap is None or self.last.heightmap.plan is None:
            return ""
        return "\n".join(step.sentence for step in self.last.heightmap.plan.steps)
