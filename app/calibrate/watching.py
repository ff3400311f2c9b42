"""The camera of a wizard: what the detection sees in its pictures, and captures of some frames."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass
from typing import Any

from PySide6.QtCore import QObject, QTimer, Signal

from app.calibrate.detection import Detection
from app.calibrate.look import Looker
from app.calibrate.still import Still
from app.sources.mailbox import Mailbox
from app.sources.processor import Failure, Outcome, Processor
from app.sources.source import Frame
from app.sources.stream import Stream
from gelpolight_core.translation import tr

POLL_MS = 30


@dataclass(frozen=True, slots=True)
class Seen:
    """What the detection made of a live frame, whether it is still, and whether anything moved.

    `moved` counts from the last :meth:`Watching.forget_movement`.
    """

    detection: Detection
    still: bool
    moved: bool


class Watching(QObject):
    """Looks at a stream with a step's detection, and takes frames from it.

    Signals
    -------
    detected(object)
        An Outcome or Failure of the detection on the live picture.
    refused(str)
        A sentence: why a capture came to nothing.
    given_up(str)
        A sentence: a capture was under way when the stream was taken away.
    """

    detected = Signal(object)
    refused = Signal(str)
    given_up = Signal(str)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.stream: Stream | None = None
        self._capture: Future[list[Frame]] | None = None
        self._still, self._moved = Still(), False
        self._take: Callable[[list[Any]], None] = lambda _frames: None
        self._inbox: Mailbox[Frame] = Mailbox()
        self._outbox: Mailbox[Outcome[Any] | Failure] = Mailbox()
        self._processor: Processor[Any] = Processor(
            self._inbox, lambda _frame: None, self._outbox, name="detection"
        )
        self._tick = QTimer(self)
        self._tick.setInterval(POLL_MS)
        self._tick.timeout.connect(self._poll)

    def set_stream(self, stream: Stream | None) -> None:
        """Look at another stream; the owner starts and stops it."""
        unfinished, self._capture = self.capturing, None
        if self.stream is not None:
            self.stream.remove_tap(self._inbox.put)
            self._processor.stop()
            self._tick.stop()
        self.stream = stream
        if stream is not None:
            self._still = Still()
            stream.add_tap(self._inbox.put)
            self._processor.start()
            self._tick.start()
        if unfinished:
            self.given_up.emit(
                tr("The picture was not taken: the camera was let go. Capture it again.")
            )

    def look_with(self, detect: Looker | None) -> None:
        """Use a detection from the next frame on; None: look for nothing."""

        def look(frame: Frame) -> Seen | None:
            # Watched whatever is looked for: a movement must not be missed for a new detection.
            quiet = self._still.update(frame.rgb, frame.time_s)
            self._moved = self._moved or self._still.moves
            if detect is None:
                return None
            return Seen(detect(frame.rgb), quiet, self._moved)

        self._processor.replace(look)

    def forget_movement(self) -> None:
        """Count movements from now on."""
        self._moved = False

    @property
    def detection_ms(self) -> float:
        """Typical time of a detection."""
        return self._processor.figures().median_ms

    @property
    def capturing(self) -> bool:
        """Whether a capture is under way."""
        return self._capture is not None

    def capture(self, frames: int, take: Callable[[list[Any]], None]) -> None:
        """Hand the next frames' pictures to `take`; one capture at a time."""
        if self._capture is not None:
            return
        if self.stream is None:
            self.refused.emit(tr("There is no camera. Choose a source first."))
            return
        self._capture, self._take = self.stream.capture(frames), take

    def _poll(self) -> None:
        item = self._outbox.take()
        # What was seen for the step before is no word on this one.
        if item is not None and item.generation == self._processor.generation:
            self.detected.emit(item)
        if self._capture is not None and self._capture.done():
            future, self._capture = self._capture, None
            error = future.exception()
            if error is not None:
                self.refused.emit(str(error))
            else:
                self._take([frame.rgb for frame in future.result()])
