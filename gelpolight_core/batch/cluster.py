"""Run frames on an existing Dask cluster; its scheduler distributes the frames.

Its workers need the same version of this program, and the same folders under the same names.
"""

from __future__ import annotations

import queue
from collections.abc import Generator, Iterator
from itertools import islice
from pathlib import Path
from typing import Any

from gelpolight_core.batch.frame_work import Halt, Outcome, failed, work
from gelpolight_core.batch.plan import Job
from gelpolight_core.batch.processes import LOOK_UP_S, ended_workers
from gelpolight_core.batch.settings import BatchSettings
from gelpolight_core.batch.stopping import Stopped, tell_workers, workers_may_go_on
from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr

ANSWER_S = 10.0
TASK_FRAMES = 16
"""Largest number of frames per task: a scheduler handles about a thousand tasks per second."""
WAITING_TASKS = 3
"""Tasks in the scheduler for each core, running and waiting."""


class ClusterRunner:
    """Sends frames to the workers of a Dask cluster.

    Parameters
    ----------
    settings : BatchSettings
        Settings for the frames.
    out : Path
        Folder of the run; each worker must see it.
    address : str
        Address of the scheduler, such as ``tcp://10.0.0.1:8786``.

    Raises
    ------
    InputError
        If Dask is not installed, or the scheduler does not respond.
    """

    def __init__(self, settings: BatchSettings, out: Path, address: str) -> None:
        self._settings, self._out, self._address = settings, out, address
        self._client = _connect(address)

    def __call__(
        self, jobs: Iterator[Job], count: int, stopped: Stopped
    ) -> Generator[list[Outcome], None, None]:
        """Yield the outcomes as they arrive; after a stop, only those of submitted tasks."""
        with self._client:
            tasks = _Tasks(self, jobs, count)
            tasks.fill()
            while tasks.sent:
                outcomes = tasks.wait()
                if stopped() or any(isinstance(outcome, Halt) for outcome in outcomes):
                    tasks.jobs = iter(())
                    tell_workers(self._out)
                yield outcomes
                tasks.fill()
        workers_may_go_on(self._out)

    def submit(self, jobs: list[Job]) -> Any:
        """Submit a task to the scheduler and return its future."""
        # Not pure: the same frames may have to be repeated, and the result is the files.
        return self._client.submit(work, self._settings, self._out, jobs, pure=False)

    def cores(self) -> int:
        """Return the number of cores; a cluster may grow and shrink."""
        cores: dict[str, int] = self._client.ncores()
        return max(sum(cores.values()), 1)

    def lost(self, error: BaseException) -> InputError:
        """Return the error for a cluster that does not work."""
        return InputError(
            tr("The cluster does not work ({reason})").format(
                reason=str(error).splitlines()[0] if str(error) else type(error).__name__
            ),
            where=self._address,
            advice=tr(
                "Check that it is running and has this program on each worker, then repeat the "
                "command to continue"
            ),
        )


class _Tasks:
    """The tasks in the scheduler."""

    def __init__(self, cluster: ClusterRunner, jobs: Iterator[Job], count: int) -> None:
        self._cluster, self.jobs = cluster, jobs
        share = count // (2 * WAITING_TASKS * cluster.cores())
        self._frames = min(max(share, 1), TASK_FRAMES)
        self.sent: dict[Any, list[Job]] = {}
        self._done: queue.SimpleQueue[Any] = queue.SimpleQueue()

    def fill(self) -> None:
        """Submit tasks until the scheduler has enough."""
        while len(self.sent) < WAITING_TASKS * self._cluster.cores():
            task = list(islice(self.jobs, self._frames))
            if not task:
                return
            self._send(task)

    def wait(self) -> list[Outcome]:
        """Wait for outcomes for a while."""
        outcomes: list[Outcome] = []
        try:
            future = self._done.get(timeout=LOOK_UP_S)
            while True:
                outcomes += self._outcomes(future)
                future = self._done.get_nowait()
        except queue.Empty:
            return outcomes

    def _send(self, task: list[Job]) -> None:
        future = self._cluster.submit(task)
        self.sent[future] = task
        future.add_done_callback(self._done.put)

    def _outcomes(self, future: Any) -> list[Outcome]:
        from distributed import KilledWorker

        task = self.sent.pop(future)
        try:
            outcomes: list[Outcome] = future.result()
        except KilledWorker:
            # The scheduler tried it on several workers. One of its frames may be the reason.
            if len(task) == 1:
                return [failed(task[0], ended_workers())]
            for job in task:
                self._send([job])
            return []
        # a worker records all errors of frames; this is an error of the cluster
        except Exception as error:
            raise self._cluster.lost(error) from error
        return outcomes


def _connect(address: str) -> Any:
    """Return a client of a scheduler."""
    try:
        from distributed import Client
    except ImportError as error:
        raise InputError(
            tr("Dask is not installed"),
            where="--scheduler",
            advice=tr("Install the program as gelpolight-studio[dask], or use --workers"),
        ) from error
    try:
        return Client(address, timeout=ANSWER_S, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise InputError(
            tr("The Dask scheduler does not respond"),
            where=address,
            advice=tr("Check that it is running and that the address is like tcp://10.0.0.1:8786"),
        ) from error
