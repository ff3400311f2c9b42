"""Print how many frames a second a batch does, with processes of this machine and through Dask.

    python tests/long/batch_figures.py sensor.gplcal press.gplrec processes 2
    python tests/long/batch_figures.py sensor.gplcal press.gplrec dask 2 --effort best --frames 40

The rate is that between the first outcomes and the last; what came before is the start, which a
run pays once: libraries, calibration, compiled functions. Processor seconds are those of this
process and of all that it started, up to the last outcome and with the start.
"""

from __future__ import annotations

import argparse
import os
import statistics
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gelpolight_core.batch.plan import plan_batch
from gelpolight_core.batch.results import FrameRow
from gelpolight_core.batch.run import BatchProgress, run_batch
from gelpolight_core.batch.settings import BatchSettings
from gelpolight_core.batch.workers import Workers, cluster, processes
from gelpolight_core.calibration.file import read_calibration


@contextmanager
def opened(kind: str, count: int) -> Iterator[Workers]:
    """Yield workers of one thread each."""
    if kind == "processes":
        with processes(count) as workers:
            yield workers
        return
    from distributed import LocalCluster

    with (
        LocalCluster(n_workers=count, threads_per_worker=1, dashboard_address=None) as local,
        cluster(local.scheduler_address) as workers,
    ):
        yield workers


def processor_s() -> float:
    """Return the processor seconds of this process and of those that it started and that ended."""
    times = os.times()
    return times.user + times.system + times.children_user + times.children_system


def measure(options: argparse.Namespace, out: Path) -> None:
    """Do the frames and print the figures."""
    calibration = read_calibration(options.calibration)
    settings = BatchSettings(
        options.calibration.absolute(),
        calibration.identity,
        "full",
        options.effort,
        tuple(options.formats.split(",")),
    )
    plan = plan_batch([options.recording], out, calibration, slice(options.frames))
    reported: list[tuple[float, FrameRow]] = []

    def report(progress: BatchProgress) -> None:
        if progress.row is not None:
            reported.append((time.perf_counter(), progress.row))

    began, used_s = time.perf_counter(), processor_s()
    workers = opened(options.way, options.workers)
    run_batch(plan, settings, out, workers, report=report, stopped=lambda: False)
    used_s = processor_s() - used_s
    # Outcomes come in groups: what the first group took is the start.
    first_s, last_s = reported[0][0], reported[-1][0]
    later = sum(at > first_s + 0.02 for at, _ in reported)
    print(
        f"{options.way} {options.workers} {options.effort}: {len(reported)} frames, start "
        f"{first_s - began:.1f} s, {later / (last_s - first_s):.2f} frames/s, "
        f"{statistics.fmean(row.seconds for _, row in reported):.3f} processor s a frame, "
        f"{used_s / len(reported):.3f} with everything around",
        flush=True,
    )


def main() -> None:
    """Measure one way in a folder that is deleted."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("calibration", type=Path)
    parser.add_argument("recording", type=Path)
    parser.add_argument("way", choices=("processes", "dask"))
    parser.add_argument("workers", type=int)
    parser.add_argument("--effort", default="fast", choices=("fast", "balanced", "best"))
    parser.add_argument("--frames", type=int, default=240)
    parser.add_argument("--formats", default="npz")
    parser.add_argument("--scratch", type=Path, help="folder for the results, on the disk to test")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory(dir=options.scratch) as scratch:
        measure(options, Path(scratch) / "out")


if __name__ == "__main__":
    main()
