"""Workers on this machine: processes of one thread each.

Not a pool of the standard library: when one of its processes is killed, it ends all the others and
does not say whose frame it was.
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
"""How long a wish to stop may wait."""
DEATHS = 2
"""A frame at which so many processes ended is left out."""
THREADS = (
    "OPENBLAS_NUM_THREADS",
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMBA_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)
"""What libraries read that would start threads of their own."""


class ProcessRunner:
    """Hands frames to processes of this machine.

    Parameters
    ----------
    settings : BatchSettings
        What the frames are done with.
    out : Path
        Folder of the run.
    workers : int
        Processes.
    """

    def __init__(self, settings: BatchSettings, out: Path, workers: int) -> None:
        self._settings, self._out, self._workers = settings, out, workers

    def __call__(
        self, jobs: Iterator[Job], count: int, stopped: Stopped
    ) -> Generator[list[Outcome], None, None]:
        """Yield the outcomes as they come; once stopped, of the frames at hand only."""
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
    """The processes at work."""

    def __init__(
        self, begin: partial[tuple[SpawnProcess, Connection]], jobs: Iterator[Job], stopped: Stopped
    ) -> None:
        self._begin, self.jobs, self._stopped = begin, jobs, stopped
        self.busy: dict[Connection, _Worker] = {}
        self._again: deque[Job] = deque()
        self._deaths: Counter[str] = Counter()

    def fill(self, workers: int) -> None:
        """Start processes while there are fewer than these, and frames for them."""
        while len(self.busy) < workers and (job := self._next()) is not None:
            process, pipe = self._begin()
            self.busy[pipe] = _Worker(process, pipe, job)
            self._give(self.busy[pipe], job)

    def wait(self) -> list[Outcome]:
        """Wait for outcomes for a while, and hand those who have one their next frame."""
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
        """End processes that are still at work, as after a second Ctrl-C."""
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
        except OSError:  # it has just been killed; the next look at its pipe tells
            return

    def _dismiss(self, worker: _Worker) -> None:
        del self.busy[worker.pipe]
        worker.pipe.close()
        worker.process.join()

    def _bury(self, worker: _Worker) -> list[Outcome]:
        """Give a killed process's frame to another, unless it has been the end of several."""
        self._dismiss(worker)
        job = worker.job
        self._deaths[job.output] += 1
        if self._deaths[job.output] < DEATHS:
            self._again.append(job)
            return []
        return [failed(job, ended_workers())]


def ended_workers() -> str:
    """Return what is said of a frame that ends its workers."""
    return tr("several processes ended while they worked on it; is there memory enough?")


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
    """Do frames until nobody asks for more; also when the leading process was killed."""
    # Ctrl-C is for the process that leads: the frame at hand is brought to its end.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        while True:
            pipe.send(work(settings, out, [pipe.recv()]))
    except (EOFError, OSError):
        return


@contextmanager
def _one_thread_each() -> Iterator[None]:
    """Let a process that is started meanwhile find that libraries shall not start threads."""
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
