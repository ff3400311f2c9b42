"""A run over many frames, which can be stopped at any time and resumed.

    batch.json   batch.jsonl   batch.csv   FOLDER/IMAGE.npz   RECORDING/RECORDING_000000.npz ...

``batch.json`` has the settings, ``batch.jsonl`` the completed frames; ``batch.csv`` is created from
it at the end.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path

from gelpolight_core.batch.frame_work import Halt, Outcome
from gelpolight_core.batch.ledger import FILE as LEDGER
from gelpolight_core.batch.ledger import BatchLedger, FrameRow
from gelpolight_core.batch.plan import BatchPlan, Job
from gelpolight_core.batch.settings import BatchSettings, begin_or_go_on
from gelpolight_core.batch.stopping import Stopped, never, workers_may_go_on
from gelpolight_core.batch.summary import write_summary
from gelpolight_core.errors import InputError
from gelpolight_core.export.heightmap_files import ending
from gelpolight_core.io.atomic import make_folder
from gelpolight_core.io.lock import RunLock
from gelpolight_core.translation import tr

Runner = Callable[[Iterator[Job], int, Stopped], Generator[list[Outcome], None, None]]
"""Processes frames: arguments are the frames, their count and whether to stop; yields outcomes."""


@dataclass(frozen=True, slots=True)
class BatchProgress:
    """Progress of a run.

    Attributes
    ----------
    total, before : int
        Frames of the plan, and those completed in earlier runs.
    done, bad, faults : int
        Frames completed now, frames without a result, and those of them with an internal error.
    row : FrameRow or None
        The last frame; None at the beginning.
    """

    total: int
    before: int
    done: int = 0
    bad: int = 0
    faults: int = 0
    row: FrameRow | None = None

    @property
    def left(self) -> int:
        """Number of frames not yet processed."""
        return self.total - self.before - self.done - self.bad

    def after(self, row: FrameRow) -> BatchProgress:
        """Return the progress after another frame."""
        bad = bool(row.error)
        return BatchProgress(
            self.total,
            self.before,
            self.done + (not bad),
            self.bad + bad,
            self.faults + row.ours,
            row,
        )


def _ignored(progress: BatchProgress) -> None:
    """Ignore progress."""


def run_batch(
    plan: BatchPlan,
    settings: BatchSettings,
    out: Path,
    runner: Runner,
    *,
    report: Callable[[BatchProgress], None] = _ignored,
    stopped: Stopped = never,
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
    runner : callable
        Processes the frames: a :class:`~gelpolight_core.batch.processes.ProcessRunner` or a
        :class:`~gelpolight_core.batch.cluster.ClusterRunner`.
    report : callable, optional
        Called with the progress, at the beginning and after each frame.
    stopped : callable, optional
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
        workers_may_go_on(out)
        for folder in sorted(plan.folders):
            make_folder(out / folder)
            _remove_parts(out / folder)
        ledger = BatchLedger(out / LEDGER)
        endings = [ending(name) for name in settings.formats]

        def is_done(job: Job) -> bool:
            return ledger.has(job.output, job.stamp) and all(
                (out / f"{job.output}.{name}").is_file() for name in endings
            )

        before = sum(map(is_done, plan))
        progress = BatchProgress(len(plan), before)
        report(progress)
        if progress.left:
            jobs = (job for job in plan if not is_done(job))
            progress = _do(jobs, progress, ledger, runner, report, stopped)
        if not progress.left:
            write_summary(ledger, out, measured=settings.shape is not None)
    return progress


def _do(
    jobs: Iterator[Job],
    progress: BatchProgress,
    ledger: BatchLedger,
    runner: Runner,
    report: Callable[[BatchProgress], None] = _ignored,
    stopped: Stopped = never,
) -> BatchProgress:
    halt: Halt | None = None
    try:
        with closing(runner(jobs, progress.left, stopped)) as results:
            for outcomes in results:
                rows = [outcome for outcome in outcomes if isinstance(outcome, FrameRow)]
                ledger.keep(rows)
                for row in rows:
                    progress = progress.after(row)
                    report(progress)
                halt = halt or next((one for one in outcomes if isinstance(one, Halt)), None)
        if halt is not None:
            raise halt.error()
    except InputError as error:
        raise _left_at(error, progress) from error
    return progress


def _left_at(error: InputError, progress: BatchProgress) -> InputError:
    """Return an error that also reports the progress of the run."""
    return InputError(
        tr("{found}; {n} of {total} frames are done").format(
            found=error.found, n=progress.before + progress.done, total=progress.total
        ),
        where=error.where,
        advice=tr("{advice}. Run the same command again to continue").format(advice=error.advice),
    )


def _remove_parts(folder: Path) -> None:
    """Remove incomplete files left by killed processes."""
    for path in folder.glob(".*.part"):
        path.unlink(missing_ok=True)
