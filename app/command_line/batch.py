"""``gelpolight batch``: turns recordings and folders of any size into depth maps."""

from __future__ import annotations

import argparse
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from types import FrameType
from typing import Any

from tqdm import tqdm

from app.command_line.reconstructing import add_effort, add_model, load_reconstructor
from app.command_line.terminal import say
from gelpolight_core.batch.cluster import ClusterRunner
from gelpolight_core.batch.plan import Selection, plan_batch
from gelpolight_core.batch.processes import ProcessRunner
from gelpolight_core.batch.run import BatchProgress, Runner, run_batch
from gelpolight_core.batch.settings import BatchSettings
from gelpolight_core.batch.summary import FILE as SUMMARY
from gelpolight_core.batch.summary import last_line
from gelpolight_core.errors import InputError
from gelpolight_core.export.heightmap_files import FORMATS
from gelpolight_core.measurement.measure import SHAPES
from gelpolight_core.translation import tr

SHOWN_FAULTS = 20
"""Bad frames that are printed during the work. The summary contains all of them."""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the arguments of the command and its function."""
    parser.add_argument("calibration", type=Path, metavar="CALIBRATION")
    parser.add_argument(
        "inputs",
        type=Path,
        nargs="+",
        metavar="INPUT",
        help=tr("recordings, images, and folders of them"),
    )
    parser.add_argument(
        "-o",
        "--output",
        type=Path,
        required=True,
        metavar="OUT",
        help=tr("folder of the run; an unfinished run is continued"),
    )
    parser.add_argument(
        "--formats",
        "--format",
        default="npz",
        metavar="LIST",
        help=tr("comma-separated list of {formats}").format(formats=", ".join(FORMATS)),
    )
    parser.add_argument(
        "--frames",
        default="",
        metavar="A:B",
        help=tr(
            "for each recording and folder: frames from A, counted from 0, up to but not "
            "including B"
        ),
    )
    parser.add_argument(
        "--every", type=int, default=1, metavar="N", help=tr("only every N-th of these frames")
    )
    parser.add_argument(
        "--measure",
        choices=SHAPES,
        metavar="SHAPE",
        help=tr("also measure the pressed object: {shapes}; takes several times as long").format(
            shapes=", ".join(SHAPES)
        ),
    )
    runners = parser.add_mutually_exclusive_group()
    runners.add_argument(
        "--workers",
        type=int,
        choices=range(1, 257),
        default=1,
        metavar="N",
        help=tr("number of worker processes on this machine, each on its own core (default: 1)"),
    )
    runners.add_argument(
        "--scheduler",
        metavar="ADDRESS",
        help=tr("address of a Dask cluster to use instead"),
    )
    add_effort(parser)
    add_model(parser)
    parser.set_defaults(run=run)


def run(options: argparse.Namespace) -> int:
    """Reconstruct every frame that has no result yet, and write the summary."""
    formats = _formats(options.formats)
    selection = _selection(options.frames, options.every)
    # Reports problems of the calibration here, before every worker would.
    reconstructor = load_reconstructor(
        options.calibration, model=options.model, effort=options.effort
    )
    calibration = reconstructor.calibration
    out = options.output.absolute()
    plan = plan_batch(options.inputs, out, calibration, selection)
    for note in plan.notes:
        say(note, file=sys.stderr)
    settings = BatchSettings(
        options.calibration.absolute(),
        calibration.identity,
        reconstructor.model,
        options.effort,
        formats,
        options.measure,
    )
    runner: Runner = (
        ClusterRunner(settings, out, options.scheduler)
        if options.scheduler
        else ProcessRunner(settings, out, options.workers)
    )
    with _stopped_by_ctrl_c() as stopped, _Progress() as report:
        progress = run_batch(plan, settings, out, runner, report=report, stopped=stopped)
    return _report(progress, options.output)


class _Progress:
    """A progress bar on stderr, with a line for each frame that could not be used."""

    def __init__(self) -> None:
        self._bar: tqdm[Any] | None = None

    def __enter__(self) -> Callable[[BatchProgress], None]:
        """Return the function that receives the progress."""
        return self._report

    def __exit__(self, *details: object) -> None:
        """Close the bar."""
        if self._bar is not None:
            self._bar.close()

    def _report(self, progress: BatchProgress) -> None:
        if self._bar is None:
            self._bar = tqdm(
                total=progress.total, initial=progress.before, file=sys.stderr, unit=tr("frame")
            )
        if progress.row is None:
            return
        if progress.row.error and progress.bad <= SHOWN_FAULTS:
            tqdm.write(_bad_line(progress), file=sys.stderr)
        self._bar.update()


def _bad_line(progress: BatchProgress) -> str:
    row = progress.row
    assert row is not None
    where = row.input
    if row.frame is not None:
        where = tr("{path}, frame {n}").format(path=where, n=row.frame)
    reason = last_line(row.error)
    for known in (row.input, Path(row.input).name):
        reason = reason.removeprefix(f"{known}: ")
    if progress.bad == SHOWN_FAULTS:
        reason += tr(" (the summary lists further frames)")
    return f"{where}: {reason}"


def _report(progress: BatchProgress, out: Path) -> int:
    """Print a summary. Return the exit status, or raise an error."""
    done = progress.before + progress.done
    if progress.left:
        tqdm.write(
            tr("{n} of {total} frames are done. Run the same command again to continue").format(
                n=done, total=progress.total
            ),
            file=sys.stderr,
        )
        raise KeyboardInterrupt
    say(
        tr("{n} depth maps in {folder}, {before} of them from earlier runs").format(
            n=done, folder=out, before=progress.before
        )
    )
    if progress.faults:
        raise RuntimeError(f"{progress.faults} frames, see batch.jsonl in {out}")
    if progress.bad:
        raise InputError(
            tr("{n} of {total} frames could not be used").format(
                n=progress.bad, total=progress.total
            ),
            where=str(out / SUMMARY),
            advice=tr(
                "The last column gives the reason. Correct the files and run the same command again"
            ),
        )
    return 0


@contextmanager
def _stopped_by_ctrl_c() -> Iterator[Callable[[], bool]]:
    """Let the first Ctrl-C finish the current frames, and only a second one interrupt them."""
    asked = False

    def note(number: int, frame: FrameType | None) -> None:
        nonlocal asked
        if asked:
            raise KeyboardInterrupt
        asked = True
        tqdm.write(tr("Stopping after the current frames."), file=sys.stderr)

    before = signal.signal(signal.SIGINT, note)
    try:
        yield lambda: asked
    finally:
        signal.signal(signal.SIGINT, before)


def _formats(text: str) -> tuple[str, ...]:
    formats = tuple(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
    unknown = sorted(set(formats) - set(FORMATS))
    if unknown or not formats:
        raise InputError(
            tr("Unknown format {name}").format(name=", ".join(unknown) or '""'),
            where="--formats",
            advice=tr("Use one or more of {formats}").format(formats=", ".join(FORMATS)),
        )
    return formats


def _selection(frames: str, every: int) -> Selection:
    first, colon, end = frames.partition(":")
    try:
        selection = Selection(int(first or 0), int(end) if end else None, every)
        if frames and not colon:
            selection = Selection(selection.first, selection.first + 1, every)
    except ValueError:
        selection = Selection(-1)
    if selection.first < 0 or every < 1 or (selection.end or 1) <= 0:
        raise InputError(
            tr("{text} selects no frames").format(text=frames if every >= 1 else every),
            where="--frames" if every >= 1 else "--every",
            advice=tr("Give whole numbers, as in --frames 0:1000 --every 10"),
        )
    return selection
