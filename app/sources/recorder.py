"""Records the frames of a stream in a separate thread, and counts lost frames."""

from __future__ import annotations

import logging
import math
import shutil
import threading
from collections import deque
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from gelpolight_core.base.errors import InputError, error_message
from gelpolight_core.output.recording.recording_format import RecordingHeader
from gelpolight_core.output.recording.recording_writer import RecordingWriter

from .source import Source, SourceFrame
from .stoppable_thread import StoppableThread
from .stream import Stream

_LOG = logging.getLogger(__name__)

QUEUE_BYTES = 256 * 2**20
"""May wait for the disk. Two seconds of a fast camera: a slower disk can never keep up."""
LEAST_QUEUE = 4
CLOSE_S = 20.0
"""Time to write what waits for the disk."""


@dataclass(frozen=True, slots=True)
class RecorderFigures:
    """Statistics of a recording.

    Attributes
    ----------
    frames : int
        Frames in the file.
    lost : int
        Frames that the source made but that did not arrive, or that arrived while the queue was
        full, because the disk or processor was too slow.
    size_bytes : int
        Size of the file.
    seconds : float
        Time from the first frame to the last one that arrived.
    failure : str or None
        Why the recording stopped by itself, as a sentence; None if there is no error.
    finished : bool
        Whether the file is closed.
    """

    frames: int = 0
    lost: int = 0
    size_bytes: int = 0
    seconds: float = 0.0
    failure: str | None = None
    finished: bool = False


def header_for(source: Source, *, serial: str = "", calibration_id: str = "") -> RecordingHeader:
    """Return the header for a recording of a source.

    Parameters
    ----------
    source : Source
        Must be open, so that its present settings can be read.
    serial, calibration_id : str, optional
        Sensor and calibration in use.
    """
    return RecordingHeader(
        serial=serial,
        calibration_id=calibration_id,
        source=source.name,
        kind=source.kind,
        settings={setting.key: setting.value for setting in source.settings()},
    )


class Recorder(StoppableThread):
    """Writes every frame of a stream to a file.

    Parameters
    ----------
    stream : Stream
        Source of the frames; running, or started later.
    path : Path
        Path of the new file.
    header : RecordingHeader
        Description of the recording.
    """

    def __init__(self, stream: Stream, path: Path, header: RecordingHeader) -> None:
        super().__init__(f"recording {path.name}")
        self.stream, self.path, self._header = stream, path, header
        self._changed = threading.Condition()
        self._queue: deque[tuple[SourceFrame, int]] = deque()
        self._ending = self._overrun = False
        self._figures = RecorderFigures()
        self._raw_number: int | None = None
        self._number, self._every = -1, 1
        self._first_s = 0.0

    def start(self) -> None:
        """Start to record, and return at once. Errors are reported by :meth:`figures`."""
        super().start()
        self.stream.add_tap(self._take)

    def finish(self) -> None:
        """Accept no more frames. Waiting frames are still written in the background."""
        self.stream.remove_tap(self._take)
        with self._changed:
            self._ending = True
            self._changed.notify_all()

    def stop(self, timeout_s: float = CLOSE_S) -> bool:
        """Accept no more frames, and wait until all are written and the file is closed."""
        self.finish()
        return super().stop(timeout_s)

    def halve_rate(self) -> None:
        """Keep every second frame from now on. The others do not count as lost."""
        with self._changed:
            self._every *= 2

    def figures(self) -> RecorderFigures:
        """Return the statistics of the recording."""
        with self._changed:
            return self._figures

    def _take(self, frame: SourceFrame) -> None:
        """Put a frame into the queue. The capture thread calls it."""
        with self._changed:
            if self._ending:
                return
            if self._raw_number is None:
                step, self._first_s = 1, frame.time_s
                self._number = frame.number - 1
            else:
                advance = frame.number - self._raw_number
                if 0 < advance < self._every:
                    return
                # A reopened source counts from 0 again; how many frames it made meanwhile is not
                # known.
                step = max(advance // self._every, 1)
            self._number += step
            self._raw_number = frame.number
            self._note(lost=step - 1, seconds=frame.time_s - self._first_s)
            if len(self._queue) >= max(LEAST_QUEUE, QUEUE_BYTES // frame.rgb.nbytes):
                self._note(lost=1)
                if not self._overrun:
                    self._overrun = True
                    _LOG.warning("The disk is too slow for %s: frames are lost", self.path)
            else:
                self._queue.append((frame, self._number))
                self._changed.notify_all()

    def _run(self, end: threading.Event) -> None:
        failure: str | None = None
        try:
            writer = RecordingWriter(self.path, self._header)
            try:
                self._write_all(writer)
            finally:
                writer.close(self._number)
        except InputError as error:
            failure = str(error)
            _LOG.error("Recording ended: %s", error)
        except Exception as error:
            _LOG.exception("Recording %s failed", self.path)
            failure = error_message(error)
        self.stream.remove_tap(self._take)
        with self._changed:
            self._ending = True
            lost = len(self._queue)  # frames that wait now are never written
            self._note(lost=lost, failure=failure, finished=True)
            self._queue.clear()

    def _note(self, lost: int = 0, **values: Any) -> None:
        """Change some of the statistics, and count further lost frames."""
        self._figures = replace(self._figures, lost=self._figures.lost + lost, **values)

    def _write_all(self, writer: RecordingWriter) -> None:
        shape = None
        while True:
            with self._changed:
                self._changed.wait_for(lambda: bool(self._queue) or self._ending)
                if not self._queue:
                    return
                frame, number = self._queue[0]
            shape = shape or (frame.rgb.shape, frame.rgb.dtype)
            if (frame.rgb.shape, frame.rgb.dtype) != shape:
                raise InputError(
                    "the size or bit depth of the images has changed",
                    self.path,
                    "The earlier images are kept; start a new recording",
                )
            writer.append(frame.rgb, number, frame.time_s)
            with self._changed:
                self._queue.popleft()
                self._note(frames=writer.frames, size_bytes=writer.size_bytes)


# Left free for the system and for the results of measurements.
RESERVE_BYTES = 1_000_000_000
# A rate from a shorter time is not known well enough.
LEAST_S = 1.0


@dataclass(frozen=True, slots=True)
class RecordingSpace:
    """Space that a recording can still use.

    Attributes
    ----------
    left_bytes : float
        Bytes up to the size limit or to the reserve on the disk, whichever comes first.
    left_s : float
        Time until then at the present rate. Infinite while the rate is not known.
    by_limit : bool
        Whether the size limit comes first.
    """

    left_bytes: float
    left_s: float
    by_limit: bool

    @property
    def full(self) -> bool:
        """Whether the recording must stop now."""
        return self.left_bytes <= 0.0

    @property
    def soon_full(self) -> bool:
        """Whether it must stop within a minute."""
        return self.left_s < 60.0


def recording_space(
    figures: RecorderFigures, *, free_bytes: float, limit_bytes: float
) -> RecordingSpace:
    """Return the space that a recording can still use.

    Parameters
    ----------
    figures : RecorderFigures
        Present statistics of the recording.
    free_bytes : float
        Free space on its disk.
    limit_bytes : float
        Largest size of a recording.
    """
    by_limit = limit_bytes - figures.size_bytes
    by_disk = free_bytes - RESERVE_BYTES
    left_bytes = min(by_limit, by_disk)
    has_rate = figures.seconds >= LEAST_S and figures.size_bytes > 0
    rate = figures.size_bytes / figures.seconds if has_rate else 0.0
    left_s = max(left_bytes, 0.0) / rate if rate > 0.0 else math.inf
    return RecordingSpace(left_bytes, left_s, by_limit <= by_disk)


def free_bytes(path: Path) -> float:
    """Return the free space on the disk of a file. Infinite if the system does not say."""
    try:
        return float(shutil.disk_usage(path.parent).free)
    except OSError:
        return math.inf
