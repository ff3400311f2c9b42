"""``gelpolight batch``: turns recordings and folders of any size into depth maps."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from types import FrameType
from typing import Any

from tqdm import tqdm

from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.lab.batch.batch_plan import BatchSettings, plan_batch
from gelpolight_core.lab.batch.batch_run import BatchProgress, run_batch
from gelpolight_core.lab.batch.batch_table import TABLE, FrameRow
from gelpolight_core.lab.batch.worker_pool import WorkerPool, dask_cluster, process_pool
from gelpolight_core.measurement.object_measurement import SHAPES

from .inputs import frame_slice
from .options import Command, option, output, positional
from .reconstructing import effort, formats, load_reconstructor, model
from .terminal import print_safe

SHOWN_FAULTS = 20
"""Frames without a result that are printed. The table contains all of them."""


def _workers(text: str) -> AbstractContextManager[WorkerPool]:
    """Return the workers of the argument."""
    if not text.isdecimal():
        return dask_cluster(text, partial(tqdm.write, file=sys.stderr))
    if int(text) < 1:
        raise InputError("At least one worker is needed", "--workers", Remedy.CORRECT_VALUE)
    return process_pool(int(text))


@dataclass(frozen=True)
class BatchCommand(Command):
    """Recordings and folders of any size become depth maps."""

    calibration: Path = positional("CALIBRATION")
    inputs: list[Path] = positional("INPUT", "recordings, images, and folders of them")
    output: Path = output("OUT", "folder of the run; an unfinished run is continued", writes=False)
    frames: slice = option(
        "for each recording and folder: every N-th frame from A, counted from 0, up to but not "
        "including B",
        type=frame_slice,
        default="",
        metavar="A:B:N",
    )
    measure: str | None = option(
        f"also measure the pressed object: {', '.join(SHAPES)}; takes several times as long",
        choices=SHAPES,
        metavar="SHAPE",
    )
    workers: AbstractContextManager[WorkerPool] = option(
        "number of worker processes on this machine, each on its own core (default: 1), or "
        "address of the scheduler of a Dask cluster",
        type=_workers,
        default="1",
        metavar="N|ADDRESS",
    )
    format: tuple[str, ...] = formats()
    effort: str = effort()
    model: str | None = model()

    def run(self) -> None:
        """Reconstruct every frame that has no result yet, and add it to the table."""
        # Reports problems of the calibration here, before every worker would.
        reconstructor = load_reconstructor(self.calibration, self.model, self.effort)
        calibration = reconstructor.calibration
        out = self.output.absolute()
        plan = plan_batch(self.inputs, out, calibration, self.frames)
        for note in plan.notes:
            print_safe(note, file=sys.stderr)
        settings = BatchSettings(
            self.calibration.absolute(),
            calibration.identity,
            reconstructor.model,
            self.effort,
            self.format,
            self.measure,
        )
        bar = tqdm(total=len(plan.jobs), file=sys.stderr, unit="frame", smoothing=0)
        with _stopped_by_ctrl_c() as stopped, bar:
            progress = run_batch(
                plan, settings, out, self.workers, report=partial(_show, bar), stopped=stopped
            )
        _report(progress, self.output)


def _show(bar: tqdm[Any], progress: BatchProgress) -> None:
    bar.initial = progress.before
    bar.update(progress.total - progress.left - bar.n)


def _fault(row: FrameRow) -> str:
    place = row.input if row.frame is None else f"{row.input}, frame {row.frame}"
    reason = row.error
    for prefix in (row.input, Path(row.input).name):
        reason = reason.removeprefix(f"{prefix}: ")
    return f"{place}: {reason}"


def _report(progress: BatchProgress, out: Path) -> None:
    """Print the frames without a result and a summary, or raise an error."""
    done, faults = progress.before + progress.done, progress.faults
    for row in faults[:SHOWN_FAULTS]:
        print_safe(_fault(row), file=sys.stderr)
    if progress.left:
        tqdm.write(
            f"{done} of {progress.total} frames are done. Run the same command again to continue",
            file=sys.stderr,
        )
        raise KeyboardInterrupt
    print_safe(f"{done} depth maps in {out}, {progress.before} of them from earlier runs")
    if internal := sum(row.internal for row in faults):
        raise RuntimeError(f"{internal} frames, see the last column of {out / TABLE}")
    if faults:
        raise InputError(
            f"{len(faults)} of {progress.total} frames could not be used, for the reason in the "
            "last column",
            out / TABLE,
            Remedy.CORRECT_AND_REPEAT,
        )


@contextmanager
def _stopped_by_ctrl_c() -> Iterator[Callable[[], bool]]:
    """Let the first Ctrl-C finish the current frames, and only a second one interrupt them."""
    is_stopping = False

    def note(number: int, frame: FrameType | None) -> None:
        nonlocal is_stopping
        if is_stopping:
            raise KeyboardInterrupt
        is_stopping = True
        tqdm.write("Stopping after the current frames.", file=sys.stderr)

    before = signal.signal(signal.SIGINT, note)
    try:
        yield lambda: is_stopping
    finally:
        signal.signal(signal.SIGINT, before)
