"""Measure the presses of a folder in several processes."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import as_completed
from functools import lru_cache
from pathlib import Path

from gelpolight_core.batch.workers import processes
from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.measurement.evaluation_run import Outcome, outcome_of, press_measurement
from gelpolight_core.measurement.press import read_truth
from gelpolight_core.reconstruction.reconstructor import Reconstructor


def measure_presses(
    presses: Path,
    calibration: Path,
    *,
    model: str | None,
    workers: int,
    progress: Callable[[str, float], None],
) -> dict[str, Outcome]:
    """Measure the images of a folder with ``truth.csv``; return the outcome of each file.

    Parameters
    ----------
    presses : Path
        The folder.
    calibration : Path
        Its file.
    model : str or None
        Of the reconstruction; None: the calibration's own.
    workers : int
        Number of images processed at the same time, in one process each.
    progress : callable
        Called with the file name and the share done, 0..1.

    Raises
    ------
    InputError
        If ``truth.csv`` or the calibration cannot be read.
    """
    outcomes: dict[str, Outcome] = {}
    with processes(workers) as pool:
        jobs = {
            pool.submit(_measure, presses / row.file, row.truth.shape, calibration, model): row.file
            for row in read_truth(presses).rows
        }
        for job in as_completed(jobs):
            outcomes[jobs[job]] = job.result()
            progress(jobs[job], len(outcomes) / len(jobs))
    return outcomes


def _measure(image: Path, shape: str, calibration: Path, model: str | None) -> Outcome:
    return outcome_of(_measurement(calibration, model), image, shape)


@lru_cache(maxsize=1)
def _measurement(calibration: Path, model: str | None) -> Callable[[Path, str], Outcome]:
    return press_measurement(Reconstructor(read_calibration(calibration), model=model, workers=1))
