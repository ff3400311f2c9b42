"""Long work in one thread, one job after the other."""

from __future__ import annotations

import logging
import queue
import threading
from collections import deque
from collections.abc import Callable
from concurrent.futures import Future
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from PySide6.QtCore import QObject, QTimer, Signal

from app.sources.stopping import join
from gelpolight_core.calibration.project import Cancelled
from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr

_LOG = logging.getLogger(__name__)
POLL_MS = 50
# What cannot be cancelled at once may take this long: a step of a computation, or a picture that
# is written to a slow disk.
CLOSE_S = 10.0


@dataclass
class Job:
    """One piece of work.

    Attributes
    ----------
    title : str
        What is shown while it runs.
    work : callable
        Gets a function to tell the share done to, which also stops the work when it was cancelled.
    done : callable
        Called in the GUI thread with what `work` returned.
    failed : callable or None
        Called in the GUI thread with a sentence where it came to nothing; None: Jobs.refused.
    stopped : callable or None
        Called in the GUI thread with a sentence where it was cancelled, as it ran or before it
        began; None: Jobs.refused, and only where it ran. Not once Jobs are closed.
    ended : callable
        Called in the GUI thread before any of these, however it ended; not once Jobs are closed.
    must : bool
        Whether it is done even where all else is cancelled.
    over : bool
        Whether it came to its end, told or stopped; it keeps nothing then.
    """

    title: str
    work: Callable[[Callable[[float], None]], Any]
    done: Callable[[Any], None] = field(default=lambda _result: None)
    failed: Callable[[str], None] | None = None
    stopped: Callable[[str], None] | None = None
    ended: Callable[[], object] = field(default=lambda: None)
    must: bool = False
    over: bool = False
    share: float = 0.0
    future: Future[Any] | None = None
    cancel: threading.Event = field(default_factory=threading.Event)


class Jobs(QObject):
    """Runs jobs in their order; tells in the GUI thread how they fare.

    Parameters
    ----------
    name : str
        Of the thread.
    parent : QObject, optional
        Owner.

    Signals
    -------
    progressed(str, float)
        Title and share of the job that runs; an empty title when there is none.
    refused(str)
        A sentence: why a job came to nothing.
    """

    progressed = Signal(str, float)
    refused = Signal(str)

    def __init__(self, name: str, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._name = name
        self._thread: threading.Thread | None = None
        self._queue: queue.SimpleQueue[Job | None] = queue.SimpleQueue()
        self._waiting: deque[Job] = deque()
        self._timer = QTimer(self)
        self._timer.setInterval(POLL_MS)
        self._timer.timeout.connect(self._poll)
        self._said = ("", 0.0)

    @property
    def busy(self) -> bool:
        """Whether anything runs or waits."""
        return bool(self._waiting)

    def submit(self, job: Job) -> None:
        """Add a job to the end."""
        job.future = Future()
        self._waiting.append(job)
        if self._thread is None:
            self._thread = threading.Thread(target=self._work, name=self._name, daemon=True)
            self._thread.start()
        self._queue.put(job)
        self._timer.start()
        self._say()

    def cancel(self) -> None:
        """Stop the job that runs, at its next step, and drop those that wait."""
        for job in self._waiting:
            if job.must:
                continue
            job.cancel.set()
            if job.future is not None:
                job.future.cancel()

    def close(self, timeout_s: float = CLOSE_S) -> bool:
        """Cancel what may be, end the thread after the rest; only what was lost is told of.

        Return whether it has ended; one that hangs is left behind.
        """
        self.cancel()
        self._timer.stop()
        kept = [job for job in self._waiting if job.must]
        self._waiting.clear()
        thread, self._thread = self._thread, None
        if thread is None:
            return True
        self._queue.put(None)
        ended = join(thread, timeout_s)
        for job in kept:
            self._tell_lost(job)
        return ended

    def _tell_lost(self, job: Job) -> None:
        """Tell of a job that had to be done, and is not."""
        assert job.future is not None
        if not job.future.done():  # it goes on as long as the program runs
            _LOG.error("%s was not done when it was closed", job.title)
            job.future.add_done_callback(partial(_log_late, job.title))
            sentence = tr("{title}: not done yet; leave the program running for a while")
            self.refused.emit(sentence.format(title=job.title))
            return
        future, job.future, job.over = job.future, None, True
        if (error := future.exception()) is not None:
            self._tell_failure(job, error)

    def _work(self) -> None:
        """Do the jobs in their order; in the thread."""
        while (job := self._queue.get()) is not None:
            self._do(job)
            del job  # the thread would keep what came of it until the next

    def _do(self, job: Job) -> None:
        future = job.future
        if future is None or not future.set_running_or_notify_cancel():
            return
        try:
            future.set_result(job.work(partial(self._tell, job)))
        except BaseException as error:  # handed to the thread that asked, which tells it
            future.set_exception(error)
        finally:
            # The error's stack refers to this frame: with what the work used, it would refer to
            # itself, and stay until Python looks for such rings.
            del future, job

    def _tell(self, job: Job, share: float) -> None:
        """Keep the share done; called in the working thread."""
        if job.cancel.is_set():
            raise Cancelled
        job.share = share

    def _poll(self) -> None:
        while self._waiting and self._waiting[0].future is not None:
            job = self._waiting[0]
            assert job.future is not None
            if not job.future.done():
                break
            self._waiting.popleft()
            self._finish(job)
        self._say()
        if not self._waiting:
            self._timer.stop()

    def _finish(self, job: Job) -> None:
        # Where `done` refers to its job, which is a ring, the result must not be in it.
        future, job.future, job.over = job.future, None, True
        assert future is not None
        job.ended()
        if future.cancelled():
            if job.stopped is not None:
                job.stopped(_stopped(job))
            return
        error = future.exception()
        if error is None:
            job.done(future.result())
        else:
            self._tell_failure(job, error)

    def _tell_failure(self, job: Job, error: BaseException) -> None:
        if isinstance(error, Cancelled):
            (job.stopped or self.refused.emit)(_stopped(job))
        elif isinstance(error, InputError):
            (job.failed or self.refused.emit)(str(error))
        else:
            _LOG.error("%s failed", job.title, exc_info=error)
            self.refused.emit(
                tr("{title}: a fault of this program ({kind}); the log has it").format(
                    title=job.title, kind=type(error).__name__
                )
            )

    def _say(self) -> None:
        said = (self._waiting[0].title, self._waiting[0].share) if self._waiting else ("", 0.0)
        if said != self._said:
            self._said = said
            self.progressed.emit(*said)


def _stopped(job: Job) -> str:
    return tr("{title}: stopped").format(title=job.title)


def _log_late(title: str, future: Future[Any]) -> None:
    """Log what became of a job that nobody waits for any more; in whatever thread ends it."""
    if not future.cancelled() and (error := future.exception()) is not None:
        _LOG.error("%s failed after it was closed", title, exc_info=error)
