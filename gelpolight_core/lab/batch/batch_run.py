"""A run over many frames, which can be stopped at any time and resumed.

    batch.csv   FOLDER/IMAGE.npz   RECORDING/RECORDING_000000.npz ...

A frame whose files and line of the table exist, made in the same way from the same input, is done.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

from gelpolight_core.base.atomic_write import make_folder
from gelpolight_core.base.errors import InputError
from gelpolight_core.base.file_lock import RunLock
from gelpolight_core.base.safe_reading import escape_undecodable
from gelpolight_core.output.formats import HEIGHT_MAP_FORMATS

from .batch_plan import BatchPlan, BatchSettings, FrameJob
from .batch_table import FrameRow, add_row, read_table, refuse_other_calibration, write_table
from .frame_worker import failed_row, reconstruct_job
from .worker_pool import WorkerPool

ENDED = "Several processes ended while working on this frame; there may be too little memory"


@dataclass(slots=True)
class BatchProgress:
    """Progress of a run.

    Attributes
    ----------
    total, before : int
        Frames of the plan, and those completed in earlier runs.
    done : int
        Frames completed now.
    faults : list of FrameRow
        Frames without a result.
    """

    total: int
    before: int
    done: int = 0
    faults: list[FrameRow] = field(default_factory=list)

    @property
    def left(self) -> int:
        """Number of frames not yet processed."""
        return self.total - self.before - self.done - len(self.faults)


def run_batch(
    plan: BatchPlan,
    settings: BatchSettings,
    out: Path,
    workers: AbstractContextManager[WorkerPool],
    *,
    report: Callable[[BatchProgress], object],
    stopped: Callable[[], bool],
) -> BatchProgress:
    """Process the frames of a plan that have no result yet.

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
        :func:`~gelpolight_core.lab.batch.worker_pool.process_pool` or
        :func:`~gelpolight_core.lab.batch.worker_pool.dask_cluster`.
    report : callable
        Called with the progress, at the beginning and after each frame.
    stopped : callable
        Returns whether to stop; frames already begun are completed.

    Raises
    ------
    InputError
        If the folder has results of another calibration, another program is using it, or the run
        cannot continue, as on a full disk; completed frames are kept.
    """
    make_folder(out)
    with RunLock(out):
        table = read_table(out)
        refuse_other_calibration(table, settings.calibration_id, out)
        for folder in {out, *((out / job.output).parent for job in plan.jobs)}:
            make_folder(folder)
            for leftover in folder.glob(".*.part"):  # left by a killed process
                leftover.unlink(missing_ok=True)
        suffixes = [HEIGHT_MAP_FORMATS[key].suffix for key in settings.formats]

        def is_done(job: FrameJob) -> bool:
            row = table.get(escape_undecodable(job.output), {})
            return (row.get("origin"), row.get("error")) == (settings.origin(job), "") and all(
                (out / f"{job.output}{suffix}").is_file() for suffix in suffixes
            )

        jobs = [job for job in plan.jobs if not is_done(job)]
        progress = BatchProgress(len(plan.jobs), len(plan.jobs) - len(jobs))
        report(progress)
        write_table(table, out)
        if jobs:
            try:
                with workers as opened:
                    for job, result in opened.submit(
                        partial(reconstruct_job, settings, out), jobs, stopped
                    ):
                        row = result or failed_row(settings, job, ENDED)
                        add_row(row, out)
                        progress.done += not row.error
                        progress.faults += [row] if row.error else []
                        report(progress)
            except InputError as error:
                done = f"{progress.before + progress.done} of {progress.total} frames are done"
                advice = f"{error.advice}. Run the same command again to continue"
                raise InputError(f"{error.found}; {done}", error.where, advice) from error
            write_table(read_table(out), out)
    return progress
