"""Workers behind one ``submit``: processes of this machine, or an existing Dask cluster.

The workers of a cluster need the same version of this program, and the same folders under the same
names; its scheduler distributes the frames.
"""

from __future__ import annotations

import asyncio
import logging
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    CancelledError,
    Future,
    ProcessPoolExecutor,
    wait,
)
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, TypeVar

from gelpolight_core.base.errors import InputError, Remedy, not_installed

LOG = logging.getLogger(__name__)
ItemT = TypeVar("ItemT")
T = TypeVar("T")
POLL_S = 0.5
"""Longest delay until a request to stop is noticed."""
ANSWER_S = 10.0
EMPTY_S = 60.0
"""How long a cluster may have no workers; one that grows with its work starts them meanwhile."""
TASKS_PER_CORE = 3
"""Tasks in the scheduler for each core, running and waiting, so that no core waits for its next."""
THREADS = (
    "OPENBLAS_NUM_THREADS",
    "OMP_NUM_THREADS",
    "MKL_NUM_THREADS",
    "NUMBA_NUM_THREADS",
    "BLIS_NUM_THREADS",
    "VECLIB_MAXIMUM_THREADS",
)
"""Environment variables of libraries that would start their own threads."""


@dataclass(frozen=True, slots=True)
class WorkerPool:
    """Executor of tasks: processes or a cluster.

    Attributes
    ----------
    start : callable
        Sends a function and its argument to a worker; returns the future of the result.
    most : callable
        Returns how many tasks they may have at a time, running and waiting.
    ended : type
        The exception of a task whose worker ended.
    """

    start: Callable[..., Future[Any]]
    most: Callable[[], int]
    ended: type[Exception]

    def submit(
        self,
        function: Callable[[ItemT], T],
        items: Iterable[ItemT],
        stopped: Callable[[], bool] = lambda: False,
    ) -> Iterator[tuple[ItemT, T | None]]:
        """Yield each item with its result as it arrives, None if it ended several workers.

        When a worker ends, as without memory, its items are repeated one by one, so that only an
        item that ends a worker alone has no result. After a stop or an error, items already begun
        are still completed.

        Raises
        ------
        InputError
            As raised by the function, or by a cluster.
        """
        waiting = iter(items)
        running: dict[Future[T], ItemT] = {}
        repeated: list[ItemT] = []
        halt: InputError | None = None
        while True:
            while (
                halt is None and len(running) < (1 if repeated else self.most()) and not stopped()
            ):
                item = repeated[0] if repeated else next(waiting, None)
                if item is None:
                    break
                running[self.start(function, item)] = item
            if not running:
                break
            for future in wait(running, POLL_S, FIRST_COMPLETED).done:
                item, result = running.pop(future), None
                try:
                    result = future.result()
                except InputError as error:
                    halt = error
                    continue
                except self.ended:
                    if item not in repeated:
                        repeated.append(item)
                        continue
                if item in repeated:
                    repeated.remove(item)
                yield item, result
        if halt is not None:
            raise halt


@contextmanager
def process_pool(count: int) -> Iterator[WorkerPool]:
    """Yield processes of this machine with one thread each.

    Parameters
    ----------
    count : int
        Their number.
    """
    # Spawned: a forked process would inherit locks of threads that it does not have.
    context = multiprocessing.get_context("spawn")

    def open_pool() -> ProcessPoolExecutor:
        return ProcessPoolExecutor(count, context, _begin_process)

    pool = open_pool()

    def start(*task: Any) -> Future[Any]:
        nonlocal pool
        try:
            return pool.submit(*task)
        except BrokenProcessPool:  # one process was killed, and the pool has ended the others
            pool = open_pool()
            return pool.submit(*task)

    try:
        yield WorkerPool(start, lambda: count + 1, BrokenProcessPool)
    except KeyboardInterrupt:  # a second one: without waiting for the frames at work
        for process in multiprocessing.active_children():
            process.terminate()
        raise
    finally:
        pool.shutdown()


def _begin_process() -> None:
    """Prepare a process: one thread, Ctrl-C only in the main process, and an end with that."""
    os.environ.update(dict.fromkeys(THREADS, "1"))  # this module loads no numerical library
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os._exit(1)


@contextmanager
def dask_cluster(address: str, note: Callable[[str], object] = LOG.info) -> Iterator[WorkerPool]:
    """Yield the workers of a Dask cluster.

    Parameters
    ----------
    address : str
        Address of the scheduler, such as ``tcp://10.0.0.1:8786``.
    note : callable, optional
        Called with a sentence when the cluster has no workers and one is waited for.

    Raises
    ------
    InputError
        If Dask is not installed, or the scheduler does not respond or fails.
    """
    try:
        from distributed import Client, KilledWorker
        from distributed.comm import connect
    except ImportError as error:
        raise not_installed("Dask", "--workers", "dask") from error

    for name in ("distributed", "distributed.client"):  # what they would print, the error says
        logging.getLogger(name).setLevel(logging.CRITICAL)

    async def call() -> None:
        reached = connect(address, timeout=ANSWER_S)
        await (await asyncio.wait_for(reached, ANSWER_S)).close()

    try:
        asyncio.run(call())  # a client without an answer would print an error when it is collected
        client = Client(address, timeout=ANSWER_S, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        text = "No Dask scheduler responds at this address (such as tcp://10.0.0.1:8786)"
        raise InputError(text, address, Remedy.CLUSTER) from error
    with client:
        # Not pure: the same frames may have to be repeated, and the result is the files.
        start = client.get_executor(pure=False).submit
        full_s, noted = time.monotonic(), False

        def most() -> int:
            nonlocal full_s, noted
            cores, now = int(sum(client.ncores().values())), time.monotonic()
            if cores:
                full_s, noted = now, False
            elif now - full_s > EMPTY_S:
                text = f"The cluster has had no workers for {EMPTY_S:.0f} seconds"
                raise InputError(text, address, Remedy.CLUSTER)
            elif not noted:
                text = f"0 workers. Waiting up to {EMPTY_S:.0f} seconds for the first one"
                note(f"{address}: {text}")
                noted = True
            return TASKS_PER_CORE * max(cores, 1)

        try:
            yield WorkerPool(start, most, KilledWorker)
        except InputError:
            raise
        except (OSError, CancelledError) as error:  # tasks are cancelled without a scheduler
            text = "The connection to the scheduler was lost"
            raise InputError(text, address, Remedy.CLUSTER) from error
        except Exception as error:  # workers record all errors of frames: the cluster fails
            reason = str(error).partition("\n")[0] or type(error).__name__
            text = f"The cluster does not work ({reason})"
            raise InputError(text, address, Remedy.CLUSTER) from error
