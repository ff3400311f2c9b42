"""Shared parts of the batch tests: a small sensor, its frames, and workers in this process."""

from collections.abc import Callable, Iterator
from concurrent.futures import Future
from concurrent.futures.process import BrokenProcessPool
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import cv2
import numpy as np
import pytest

from gelpolight_core.base.errors import InputError
from gelpolight_core.calibration.calibration_file import write_calibration
from gelpolight_core.lab.batch.batch_plan import BatchPlan, BatchSettings, plan_batch
from gelpolight_core.lab.batch.batch_run import BatchProgress, run_batch
from gelpolight_core.lab.batch.worker_pool import WorkerPool
from gelpolight_core.output.recording.recording_format import RecordingHeader
from gelpolight_core.output.recording.recording_writer import RecordingWriter

ALL = slice(None)


@pytest.fixture(scope="session")
def calibration_file(small_calibration, tmp_path_factory):
    path = tmp_path_factory.mktemp("sensor") / "small.gplcal"
    write_calibration(small_calibration, path)
    return path


@pytest.fixture
def day(small_session, tmp_path):
    """Return a folder with a recording of four frames, and two images in their own folder."""
    folder = tmp_path / "day"
    (folder / "left").mkdir(parents=True)
    press = next(iter(sorted((small_session / "presses").glob("*.png"))))
    bgr = cv2.imread(str(press))
    with RecordingWriter(folder / "run.gplrec", RecordingHeader(serial="virtual-1")) as writer:
        for number in range(4):
            rgb = np.ascontiguousarray(np.roll(bgr[..., ::-1], number, axis=1))
            writer.append(rgb, 10 + number, 5.0 + number / 30)
    for name in ("a.png", "b.png"):
        assert cv2.imwrite(str(folder / "left" / name), bgr)
    return folder


@pytest.fixture
def settings(calibration_file, small_calibration):
    return BatchSettings(
        calibration_file, small_calibration.identity, "paper", "best", ("npz", "tif")
    )


@pytest.fixture
def plan(small_calibration):
    """Return a function that plans a run."""

    def make(*inputs: Path, out: Path, selection: slice = ALL) -> BatchPlan:
        return plan_batch(inputs, out, small_calibration, selection)

    return make


@contextmanager
def in_this_process(*_: object) -> Iterator[WorkerPool]:
    """Yield a worker without any other process."""

    def start(function: Callable[..., object], *arguments: object) -> Future[object]:
        future: Future[object] = Future()
        try:
            future.set_result(function(*arguments))
        except InputError as error:
            future.set_exception(error)
        return future

    yield WorkerPool(start, lambda: 1, BrokenProcessPool)


Go = Callable[..., BatchProgress]


@pytest.fixture
def go(settings, plan):
    """Return a function that runs a batch, optionally only until a number of frames is done."""

    def run(
        *inputs: Path,
        out: Path,
        until: int | None = None,
        workers: AbstractContextManager[WorkerPool] | None = None,
        selection: slice = ALL,
        after: Callable[[], object] = lambda: None,
    ) -> BatchProgress:
        processed = 0

        def report(progress: BatchProgress) -> None:
            nonlocal processed
            processed = progress.done + len(progress.faults)
            if processed:
                after()

        return run_batch(
            plan(*inputs, out=out, selection=selection),
            settings,
            out,
            workers or in_this_process(),
            report=report,
            stopped=lambda: until is not None and processed >= until,
        )

    return run
