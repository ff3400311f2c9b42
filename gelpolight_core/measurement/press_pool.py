"""Measure the presses of a folder in several processes.

Each process has one thread: two threads cannot use the compiled loops at the same time, and two
images in parallel use two cores better than one image.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import threading
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing.connection import wait
from pathlib import Path

from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.measurement.evaluation_run import measure_press
from gelpolight_core.measurement.ledger import Ledger
from gelpolight_core.measurement.presses import press_measurement
from gelpolight_core.measurement.result import Measurement
from gelpolight_core.measurement.truth import read_truth
from gelpolight_core.reconstruction.reconstructor import Reconstructor


def measure_folder(
    presses: Path,
    calibration: Path,
    ledger: Ledger,
    *,
    model: str | None = None,
    workers: int = 2,
    progress: Callable[[str, float], None] | None = None,
) -> None:
    """Measure the images of a folder with ``truth.csv``, several at a time, into a ledger.

    Parameters
    ----------
    presses : Path
        The folder.
    calibration : Path
        Its file.
    ledger : Ledger
        Keeps what is measured.
    model : str, optional
        Of the reconstruction; by default the calibration's own.
    workers : int, optional
        Number of images processed at the same time.
    progress : callable, optional
        Called with the file name and the share done, 0..1.

    Raises
    ------
    InputError
        If ``truth.csv`` or the calibration cannot be read, or the ledger cannot be written.
    """
    rows = [row for row in read_truth(presses).rows if (presses / row.file).is_file()]
    # Spawned: a forked process would inherit locks of threads that it does not have.
    context = multiprocessing.get_context("spawn")
    pool = ProcessPoolExecutor(
        workers, mp_context=context, initializer=_begin, initargs=(calibration, model)
    )
    try:
        jobs = {pool.submit(_measure, presses / row.file, row.truth.shape): row for row in rows}
        for number, job in enumerate(as_completed(jobs), start=1):
            row, outcome = jobs[job], job.result()
            key = ledger.key(presses / row.file, row.truth.shape)
            if key is not None:
                ledger.keep(key, outcome)
            if progress is not None:
                progress(row.file, number / len(jobs))
    finally:
        pool.shutdown(cancel_futures=True)


_measured: Callable[[Path, str], Measurement]


def _begin(calibration: Path, model: str | None) -> None:
    """Prepare a process."""
    global _measured
    # Only the main process handles Ctrl-C: the present press is finished.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, daemon=True).start()
    reconstructor = Reconstructor(read_calibration(calibration), model=model, workers=1)
    _measured = press_measurement(reconstructor)


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        wait([parent.sentinel])
        os._exit(1)


def _measure(image: Path, shape: str) -> Measurement | str:
    return measure_press(image, shape, _measured)
