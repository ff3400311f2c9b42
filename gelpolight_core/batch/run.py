"""A run over many frames, which can be stopped at any time and resumed.

    batch.json   batch.jsonl   batch.csv   FOLDER/IMAGE.npz   RECORDING/RECORDING_000000.npz ...

``batch.json`` has the settings, ``batch.jsonl`` the completed frames; ``batch.csv`` is created from
it at the end.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import FIRST_COMPLETED, Future, wait
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from gelpolight_core.batch.plan import BatchPlan, Job
from gelpolight_core.batch.results import (
    FrameRow,
    damaged_lines,
    finished_frames,
    keep_rows,
    write_summary,
)
from gelpolight_core.batch.settings import BatchSettings, begin_or_go_on
from gelpolight_core.batch.work import failed, work
from gelpolight_core.batch.workers import Workers
from gelpolight_core.errors import InputError
from gelpolight_core.export.heightmap_files import ending
from gelpolight_core.io.atomic import make_folder
from gelpolight_core.io.lock import RunLock

POLL_S = 0.5
"""Longest delay until a request to stop is noticed."""
ENDED = "Several processes ended while working on this frame; there may be too little memory"


@dataclass(slots=True)
class BatchProgress:
    """Progress of a run.

    Attributes
    ----------
    total, before : int
        Frames of the plan, and those completed in earlier runs.
    done, bad, internal : int
        Frames completed now, frames without a result, and those of them with an internal error.
    row : FrameRow or None
        The last frame; None at the beginning.
    damaged : int
        Damaged lines of the run's file; their frames count as not completed.
    """

    total: int
    before: int
    done: int = 0
    bad: int = 0
    internal: int = 0
    row: FrameRow | None = None
    damaged: int = 0

    @property
    def left(self) -> int:
        """Number of frames not yet processed."""
        return self.total - self.before - self.done - self.bad


def run_batch(
    plan: BatchPlan,
    settings: BatchSettings,
    out: Path,
    workers: AbstractContextManager[Workers],
    *,
    report: Callable[[BatchProgress], object],
    stopped: Callable[[], bool],
) -> BatchProgress:
    """Process the frames of a plan that have no result yet; write the summary when all are done.

    A frame that could not be used is tried again when the run is resumed.

    Parameters
    ----------
    plan : BatchPlan
        The frames.
    settings : BatchSettings
        Settings for the frames.
    out : Path
        Folder of the run, created if it does not exist.
    workers : context manager
        :func:`~gelpolight_core.batch.workers.processes` or
        :func:`~gelpolight_core.batch.workers.cluster`.
    report : callable
        Called with the progress, at the beginning and after each frame.
    stopped : callable
        Returns whether to stop; frames already begun are completed.

    Raises
    ------
    InputError
        If the run in the folder was started with other settings, another program is using it, or it
        cannot continue, as on a full disk; completed frames are kept.
    """
    make_folder(out)
    with RunLock(out):
        begin_or_go_on(settings, out)
        for folder in {"", *(source.output for source in plan.sources)}:
            make_folder(out / folder)
            for part in (out / folder).glob(".*.part"):  # left by a killed process
                part.unlink(missing_ok=True)
        finished = finished_frames(out)
        endings = [ending(name) for name in settings.formats]

        def is_done(job: Job) -> bool:
            return (job.output, job.stamp) in finished and all(
                (out / f"{job.output}.{name}").is_file() for name in endings
            )

        before = sum(map(is_done, plan))
        progress = BatchProgress(len(plan), before, damaged=damaged_lines(out))
        report(progress)
        if progress.left:
            jobs = (job for job in plan if not is_done(job))
            try:
                with workers as opened:
                    for rows in _rows(opened, partial(work, settings, out), jobs, stopped):
                        keep_rows(rows, out)
                        for row in rows:
                            progress.row = row
                            progress.done += not row.error
                            progress.bad += bool(row.error)
                            progress.internal += row.internal
                            report(progress)
            except InputError as error:
                raise InputError(
                    (
                        f"{error.found}; {progress.before + progress.done} "
                        f"of {progress.total} frames are done"
                    ),
                    error.where,
                    f"{error.advice}. Run the same command again to continue",
                ) from error
        if not progress.left:
            write_summary(out, measured=settings.measure is not None)
    return progress


def _rows(
    workers: Workers,
    task: Callable[[Job], FrameRow],
    jobs: Iterator[Job],
    stopped: Callable[[], bool],
) -> Iterator[list[FrameRow]]:
    """Yield rows as they arrive; after a stop or an error, only those of frames already begun.

    When a worker ends, as without memory, its frames are repeated one by one, so that only a frame
    that ends a worker alone is left out.
    """
    running: dict[Future[FrameRow], Job] = {}
    repeated: list[Job] = []
    halt: InputError | None = None
    while True:
        while halt is None and len(running) < (1 if repeated else workers.most()) and not stopped():
            job = repeated[0] if repeated else next(jobs, None)
            if job is None:
                break
            running[workers.submit(task, job)] = job
        if not running:
            break
        rows = []
        for future in wait(running, POLL_S, FIRST_COMPLETED).done:
            job = running.pop(future)
            try:
                rows.append(future.result())
            except InputError as error:
                halt = error
            except workers.ended:
                if job not in repeated:
                    repeated.append(job)
                    continue
                rows.append(failed(job, ENDED))
            if job in repeated:
                repeated.remove(job)
        if rows:
            yield rows
    if halt is not None:
        raise halt
