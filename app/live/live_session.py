"""One live session: the selected source, its stream, and a function of each image."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any

from PySide6.QtCore import QObject, Signal

from app.program.context import AppContext
from app.sources.latest import Latest
from app.sources.player import Player
from app.sources.recording import RecordingSource
from app.sources.source import Source, SourceFrame
from app.sources.stoppable_thread import PROCESSING
from app.sources.stream import Stream
from app.widgets.timers import timer
from gelpolight_core.image.change_detection import NEVER_S


@dataclass(frozen=True, slots=True)
class _PendingCapture:
    """A capture in progress, with the functions that get the result."""

    frames: Future[list[SourceFrame]]
    done: Callable[[list[Any]], object]
    failed: Callable[[str], object]
    aborted: Callable[[str], object]


class LiveSession(QObject):
    """The live images of one page: open while the page is visible and needs images.

    One thread reads the frames of the source, another runs a function on the newest one. Results
    of a replaced function or of a closed source are dropped.

    Parameters
    ----------
    context : AppContext
        Holds the source that all pages share.
    name : str
        Name of the processing thread.
    keeps_seen : bool, optional
        Whether captures can use frames that were already seen.
    parent : QObject, optional
        Owner.

    Attributes
    ----------
    stream : Stream or None
        Delivers the frames. None while no source is open.
    page_shown, paused : bool
        Whether the page is visible, and whether new frames are ignored.

    Signals
    -------
    source_changed()
        Another source was selected. It is opened afterwards.
    switched()
        The stream was replaced or removed.
    lost(str)
        Why no images arrive, as a sentence. Empty if they do.
    processed(object)
        Done: the result of the function for the newest frame.
    """

    source_changed = Signal()
    switched = Signal()
    lost = Signal(str)
    processed = Signal(object)

    def __init__(
        self,
        *,
        context: AppContext,
        name: str,
        keeps_seen: bool = False,
        parent: QObject | None = None,
    ) -> None:
        super().__init__(parent)
        self._context, self._keeps_seen = context, keeps_seen
        self.stream: Stream | None = None
        self._kept: dict[str, Any] = {}
        self.page_shown, self._wanted = False, True
        self.paused = self._resting = False
        self._lost = ""
        self._capture: _PendingCapture | None = None
        self._function: Callable[[SourceFrame], Any] = lambda _frame: None
        self._latest: Latest[SourceFrame, Any] = Latest(
            self._function, name=name, priority=PROCESSING
        )
        self._tick = timer(self, 8, self._poll, precise=True)
        self._status = timer(self, 500, self._update_status)
        self._following = context.source.changed.connect(self._on_source)

    # When the source is open

    def enter(self, page_shown: bool) -> None:
        """Note whether the page is visible, and open or close the source accordingly."""
        self.page_shown = page_shown
        self.open()

    def use(self, on: bool) -> None:
        """Start or stop capturing. Unused images would only slow down other work."""
        if on != self._wanted:
            self._wanted = on
            self.open()

    def open(self) -> None:
        """Open the selected source, if the page is visible and needs images."""
        self._close()
        info = self._context.source.info
        if info is not None and self.page_shown and self._wanted:
            source, self._kept = info.open(), self._context.source.kept
            if isinstance(source, Player) and "playback" in self._kept:
                source.resume(self._kept["playback"])
            self.stream = Stream(source, keeps_seen=self._keeps_seen)
            if not self.paused:
                self.stream.add_tap(self._latest.submit)
            self.stream.start()
            self._latest.start()
            self._tick.start()
            self._status.start()
        self.switched.emit()

    def finish(self) -> None:
        """Release the source for good."""
        QObject.disconnect(self._following)
        if self.page_shown:
            self.enter(False)

    def _on_source(self) -> None:
        self.source_changed.emit()
        self.open()

    def _close(self) -> None:
        self._tick.stop()
        self._status.stop()
        capture, self._capture = self._capture, None
        if self.stream is not None:
            if isinstance(source := self.stream.source, Player):
                self._kept["playback"] = source.playback()
            self.stream.remove_tap(self._latest.submit)
            self._latest.stop()
            self._resting = False
            self.stream.stop()
            self.stream = None
            # Only the session that had the source open may change the status.
            self._context.status.update(rate_hz=None, lost=None)
        self._latest.forget()
        self._latest.replace(self._function)
        self._set_lost("")
        if capture is not None:
            capture.aborted(
                "The image was not captured because the camera was released. Capture it again."
            )

    # What is computed

    @property
    def source(self) -> Source | None:
        """The open source. None if there is none."""
        return None if self.stream is None else self.stream.source

    @property
    def serial(self) -> str:
        """Serial of the sensor of the open source. Empty if unknown."""
        source, bench = self.source, self._context.source.virtual
        if source is not None and bench is not None:
            return bench.design.serial
        if isinstance(source, RecordingSource) and source.header is not None:
            return source.header.serial
        return ""

    def process(self, function: Callable[[SourceFrame], Any]) -> None:
        """Run another function on the frames from now on, and drop results in progress."""
        self._function = function
        self._latest.replace(function)

    def process_again(self, frame: SourceFrame) -> None:
        """Process a frame again while the images are paused, and drop results in progress."""
        if self.paused:
            self._latest.replace(self._function)
            self._latest.submit(frame)

    def pause(self, on: bool) -> None:
        """Ignore new frames, or continue."""
        if on == self.paused:
            return
        self.paused = on
        if self.stream is not None:
            (self.stream.remove_tap if on else self.stream.add_tap)(self._latest.submit)
        self._latest.forget()

    def suspend(self, on: bool) -> None:
        """Stop processing while another thread uses what the function needs."""
        if self.stream is None or on == self._resting:
            return
        self._resting = on
        (self._latest.stop if on else self._latest.start)()

    # Captures

    @property
    def capturing(self) -> bool:
        """Whether a capture is in progress."""
        return self._capture is not None

    def capture(
        self,
        count: int,
        done: Callable[[list[Any]], object],
        failed: Callable[[str], object],
        *,
        aborted: Callable[[str], object] | None = None,
        still_s: tuple[float, float] = NEVER_S,
    ) -> None:
        """Collect frames that show the present state of the source.

        A second capture before the first one has ended is ignored.

        Parameters
        ----------
        count : int
            Number of frames.
        done : callable
            Called with their images, each (rows, columns, 3).
        failed : callable
            Called with a sentence instead if they cannot be captured.
        aborted : callable, optional
            Called with a sentence instead if the source is closed meanwhile. Default: `failed`.
        still_s : (float, float), optional
            As in :meth:`app.sources.stream.Stream.capture`.
        """
        if self._capture is not None:
            return
        if self.stream is None:
            failed("There is no camera. Select a source first.")
            return
        frames = self.stream.capture(count, still_s)
        self._capture = _PendingCapture(frames, done, failed, aborted or failed)

    def _poll(self) -> None:
        if (done := self._latest.take()) is not None:
            self.processed.emit(done)
        if self._capture is not None and self._capture.frames.done():
            capture, self._capture = self._capture, None
            error = capture.frames.exception()
            if error is not None:
                capture.failed(str(error))
            else:
                capture.done([frame.rgb for frame in capture.frames.result()])

    # Status

    def _update_status(self) -> None:
        if self.stream is None:
            return
        figures = self.stream.figures()
        self._context.status.update(rate_hz=figures.rate_hz, lost=figures.dropped)
        self._set_lost(figures.lost or "")

    def _set_lost(self, why: str) -> None:
        if why != self._lost:
            self._lost = why
            self.lost.emit(why)
