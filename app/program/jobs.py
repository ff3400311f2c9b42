"""Long work in one background thread, one job after the other."""

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

from PySide6.QtCore import QObject, Signal

from app.sources.stoppable_thread import join
from app.widgets.timers import timer
from gelpolight_core.base.errors import InputError
from gelpolight_core.calibration.project import Cancelled

_LOG = logging.getLogger(__name__)
# Longest time for work that cannot be cancelled at once, such as one step of a computation or
# writing an image to a slow disk.
CLOSE_S = 10.0


@dataclass
class BackgroundJob:
    """One piece of work for the background thread, with the functions that get its result.

    Attributes
    ----------
    title : str
        Shown while the job runs.
    work : callable
        Gets a function that reports progress (0 to 1). That function also stops the work if the
        job was cancelled.
    done : callable
        Called in the GUI thread with the return value of `work`.
    failed : callable or None
        Called in the GUI thread with a sentence if the job fails. None: emit `JobQueue.refused`.
    stopped : callable or None
        Called in the GUI thread with a sentence if the job is cancelled, while it runs or before
        it starts. None: emit `JobQueue.refused`, only if it was running. Not called after the
        queue is closed.
    ended : callable
        Called in the GUI thread before any of these, whatever the result. Not called after the
        queue is closed.
    must : bool
        Whether the job also runs when all others are cancelled.
    over : bool
        Whether the job has ended and its result was delivered or dropped.
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
    cancelled: bool = False


Queued = tuple[BackgroundJob, Future[Any]]


class JobQueue(QObject):
    """Runs jobs in order and reports their progress in the GUI thread.

    Parameters
    ----------
    name : str
        Name of the thread.
    parent : QObject, optional
        Owner.

    Signals
    -------
    progressed(str, float)
        Title and progress (0 to 1) of the running job. An empty title: no job is running.
    refused(str)
        A sentence: why a job failed.
    """

    progressed = Signal(str, float)
    refused = Signal(str)

    def __init__(self, name: str, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._name = name
        self._thread: threading.Thread | None = None
        self._queue: queue.SimpleQueue[Queued | None] = queue.SimpleQueue()
        self._waiting: deque[Queued] = deque()
        self._timer = timer(self, 50, self._poll)
        self._progress = ("", 0.0)

    @property
    def busy(self) -> bool:
        """Whether a job is running or waiting."""
        return bool(self._waiting)

    def submit(self, job: BackgroundJob) -> None:
        """Add a job to the end of the queue."""
        queued = job, Future[Any]()
        self._waiting.append(queued)
        if self._thread is None:
            self._thread = threading.Thread(
                target=_work, args=(self._queue,), name=self._name, daemon=True
            )
            self._thread.start()
        self._queue.put(queued)
        self._timer.start()
        self._say()

    def cancel(self) -> None:
        """Stop the running job at its next step and drop the waiting ones."""
        for job, future in self._waiting:
            if not job.must:
                job.cancelled = True
                future.cancel()

    def close(self, timeout_s: float = CLOSE_S) -> bool:
        """Cancel all jobs that may be cancelled and end the thread after the others.

        Only lost work is reported. Return whether the thread has ended; a hanging one is abandoned.
        """
        self.cancel()
        self._timer.stop()
        required = [(job, future) for job, future in self._waiting if job.must]
        self._waiting.clear()
        thread, self._thread = self._thread, None
        if thread is None:
            return True
        self._queue.put(None)
        ended = join(thread, timeout_s)
        for job, future in required:
            self._report_lost(job, future)
        return ended

    def _report_lost(self, job: BackgroundJob, future: Future[Any]) -> None:
        """Report a job that had to run and has not finished."""
        if not future.done():  # it continues as long as the program runs
            _LOG.error("%s had not finished when the page closed", job.title)
            future.add_done_callback(partial(_log_late, job.title))
            self.refused.emit(
                f"{job.title}: not finished yet. Keep the program running for a while"
            )
            return
        job.over = True
        if (error := future.exception()) is not None:
            self._report_failure(job, error)

    def _poll(self) -> None:
        while self._waiting and self._waiting[0][1].done():
            self._finish(*self._waiting.popleft())
        self._say()
        if not self._waiting:
            self._timer.stop()

    def _finish(self, job: BackgroundJob, future: Future[Any]) -> None:
        job.over = True
        job.ended()
        if future.cancelled():
            if job.stopped is not None:
                job.stopped(_stopped(job))
            return
        error = future.exception()
        if error is None:
            job.done(future.result())
        else:
            self._report_failure(job, error)

    def _report_failure(self, job: BackgroundJob, error: BaseException) -> None:
        if isinstance(error, Cancelled):
            (job.stopped or self.refused.emit)(_stopped(job))
        elif isinstance(error, InputError):
            (job.failed or self.refused.emit)(str(error))
        else:
            _LOG.error("%s failed", job.title, exc_info=error)
            self.refused.emit(
                f"{job.title}: internal error ({type(error).__name__}). See the log for details"
            )

    def _say(self) -> None:
        progress = next(((job.title, job.share) for job, _ in self._waiting), ("", 0.0))
        if progress != self._progress:
            self._progress = progress
            self.progressed.emit(*progress)


def _work(jobs: queue.SimpleQueue[Queued | None]) -> None:
    """Run jobs in order, in their thread, which holds no QObject: it could be the last to do so."""
    while (queued := jobs.get()) is not None:
        _do(*queued)
        del queued  # otherwise the thread would keep the result until the next job


def _do(job: BackgroundJob, future: Future[Any]) -> None:
    if not future.set_running_or_notify_cancel():
        return
    try:
        future.set_result(job.work(partial(_report, job)))
    except BaseException as error:  # passed to the GUI thread, which reports it
        future.set_exception(error)
    finally:
        # The traceback refers to this frame. Together with the objects of the work this would
        # be a reference cycle that stays until the garbage collector runs.
        del future, job


def _report(job: BackgroundJob, share: float) -> None:
    """Store the progress. Called in the worker thread."""
    if job.cancelled:
        raise Cancelled
    job.share = share


def _stopped(job: BackgroundJob) -> str:
    return f"{job.title}: stopped"


def _log_late(title: str, future: Future[Any]) -> None:
    """Log the end of a job that nothing waits for any more, in the thread that ends it."""
    if not future.cancelled() and (error := future.exception()) is not None:
        _LOG.error("%s failed after it was closed", title, exc_info=error)
