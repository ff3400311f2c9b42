"""Workers on this machine: processes with one thread each.

This is not a pool of the standard library: when one of its processes is killed, a pool ends all
others and does not report whose frame it was.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
from collections import Counter, deque
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from multiprocessing.connection import Connection, wait
from multiprocessing.context import SpawnProcess
from pathlib import Path

from gelpolight_core.batch.frame_work import Halt, Outcome, failed, work
from gelpolight_core.batch.plan import Job
from gelpolight_core.batch.settings import BatchSettings
from gelpolight_core.batch.stopping import Stopped
from gelpolight_core.translation import tr

LOOK_UP_S = 0.5
"""Longest delay until a request to stop is noticed."""
DEATHS = 2
"""A frame on which this many processes ended is left out."""
THREADS = (
    "OPENBLAS_NUM_THREADS",
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMBA_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)
"""Environment variables of libraries that would start their own threads."""


class ProcessRunner:
    """Sends frames to processes on this machine.

    Parameters
    ----------
    settings : BatchSettings
        Settings for the frames.
    out : Path
        Folder of the run.
    workers : int
        Number of processes.
    """

    def __init__(self, settings: BatchSettings, out: Path, workers: int) -> None:
        self._settings, self._out, self._workers = settings, out, workers

    def __call__(
        self, jobs: Iterator[Job], count: int, stopped: Stopped
    ) -> Generator[list[Outcome], None, None]:
        """Yield the outcomes as they arrive; after a stop, only those of frames already begun."""
        crew = _Crew(partial(_begin, self._settings, self._out), jobs, stopped)
        try:
            crew.fill(min(self._workers, count))
            while crew.busy:
                outcomes = crew.wait()
                if any(isinstance(outcome, Halt) for outcome in outcomes):
                    crew.jobs = iter(())
                yield outcomes
                crew.fill(min(self._workers, count))
        finally:
            crew.end()


@dataclass(slots=True)
class _Worker:
    process: SpawnProcess
    pipe: Connection
    job: Job


class _Crew:
    """The running processes."""

    def __init__(
        self, begin: partial[tuple[SpawnProcess, Connection]], jobs: Iterator[Job], stopped: Stopped
    ) -> None:
        self._begin, self.jobs, self._stopped = begin, jobs, stopped
        self.busy: dict[Connection, _Worker] = {}
        self._again: deque[Job] = deque()
        self._deaths: Counter[str] = Counter()

    def fill(self, workers: int) -> None:
        """Start processes up to the given number, as long as there are frames for them."""
        while len(self.busy) < workers and (job := self._next()) is not None:
            process, pipe = self._begin()
            self.busy[pipe] = _Worker(process, pipe, job)
            self._give(self.busy[pipe], job)

    def wait(self) -> list[Outcome]:
        """Wait for outcomes for a while, and give each free worker its next frame."""
        outcomes: list[Outcome] = []
        for pipe in wait(list(self.busy), LOOK_UP_S):
            assert isinstance(pipe, Connection)
            worker = self.busy[pipe]
            try:
                done: list[Outcome] = pipe.recv()
            except (EOFError, OSError):  # it was killed
                outcomes += self._bury(worker)
                continue
            outcomes += done
            job = None if any(isinstance(outcome, Halt) for outcome in done) else self._next()
            if job is None:
                self._dismiss(worker)
            else:
                self._give(worker, job)
        return outcomes

    def end(self) -> None:
        """Terminate running processes, as after a second Ctrl-C."""
        for worker in self.busy.values():
            worker.process.terminate()
            worker.process.join()
            worker.pipe.close()
        self.busy.clear()

    def _next(self) -> Job | None:
        if self._stopped():
            return None
        return self._again.popleft() if self._again else next(self.jobs, None)

    def _give(self, worker: _Worker, job: Job) -> None:
        worker.job = job
        try:
            worker.pipe.send(job)
        except OSError:  # it was just killed; the next poll of its pipe detects this
            return

    def _dismiss(self, worker: _Worker) -> None:
        del self.busy[worker.pipe]
        worker.pipe.close()
        worker.process.join()

    def _bury(self, worker: _Worker) -> list[Outcome]:
        """Give the frame of a killed process to another, unless it has ended several already."""
        self._dismiss(worker)
        job = worker.job
        self._deaths[job.output] += 1
        if self._deaths[job.output] < DEATHS:
            self._again.append(job)
            return []
        return [failed(job, ended_workers())]


def ended_workers() -> str:
    """Return the message for a frame that ends its workers."""
    return tr("Several processes ended while working on this frame; there may be too little memory")


def _begin(settings: BatchSettings, out: Path) -> tuple[SpawnProcess, Connection]:
    """Start a process; return it and our end of its pipe."""
    # Spawned: a forked process would inherit locks of threads that it does not have.
    context = multiprocessing.get_context("spawn")
    ours, theirs = context.Pipe()
    process = context.Process(target=_serve, args=(theirs, settings, out), daemon=True)
    with _one_thread_each():
        process.start()
    theirs.close()
    return process, ours


def _serve(pipe: Connection, settings: BatchSettings, out: Path) -> None:
    """Process frames until there are no more, or until the main process has ended."""
    # The main process handles Ctrl-C: the present frame is completed.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        while True:
            pipe.send(work(settings, out, [pipe.recv()]))
    except (EOFError, OSError):
        return


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Prevent libraries in processes started meanwhile from starting their own threads."""
    before = {name: os.environ.get(name) for name in THREADS}
    os.environ.update(dict.fromkeys(THREADS, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            if value is None:
                del os.environ[name]
            else:
                os.environ[name] = value
