"""Measure the presses of a folder for an evaluation."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from gelpolight_core.errors import InputError
from gelpolight_core.measurement.evaluation import Crossing, Evaluation, evaluate
from gelpolight_core.measurement.ledger import Ledger
from gelpolight_core.measurement.result import Measurement
from gelpolight_core.measurement.truth import read_truth
from gelpolight_core.translation import tr

Progress = Callable[[str, float], None]


def evaluate_presses(
    folder: Path,
    measure: Callable[[Path, str], Measurement],
    *,
    progress: Progress | None = None,
    crossing: Crossing | None = None,
    ledger: Ledger | None = None,
) -> Evaluation:
    """Measure every press of a folder with ``truth.csv`` and compare it with the truth.

    Parameters
    ----------
    folder : Path
        Images and ``truth.csv``.
    measure : callable (image's path, shape) -> Measurement
        From :func:`~gelpolight_core.measurement.presses.press_measurement`.
    progress : callable, optional
        Called with the file name and the share done, 0..1.
    crossing : Crossing, optional
        Of the series, where a protocol was pressed.
    ledger : Ledger, optional
        What is written there is not measured again; what is measured is written there.

    Raises
    ------
    InputError
        ``truth.csv`` cannot be used, or a file it names is missing. An image that cannot be
        reconstructed or measured is a result with its reason instead.
    """
    table = read_truth(folder)
    missing = [row.file for row in table.rows if not (folder / row.file).is_file()]
    if missing:
        raise InputError(
            tr("{count} of {all} images are missing, first {file}").format(
                count=len(missing), all=len(table.rows), file=missing[0]
            ),
            where=str(folder / "truth.csv"),
            advice=tr("Put the images beside truth.csv or take their rows out"),
        )
    outcomes: list[Measurement | str] = []
    for k, row in enumerate(table.rows):
        if progress is not None:
            progress(row.file, k / len(table.rows))
        outcomes.append(measure_press(folder / row.file, row.truth.shape, measure, ledger))
    if progress is not None:
        progress("", 1.0)
    return evaluate(table.rows, outcomes, skipped=table.skipped, crossing=crossing)


def measure_press(
    path: Path,
    shape: str,
    measure: Callable[[Path, str], Measurement],
    ledger: Ledger | None = None,
) -> Measurement | str:
    """Measure the object in an image, or return as a sentence why it cannot be measured.

    Parameters
    ----------
    path : Path
        The image.
    shape : str
        What is pressed.
    measure : callable (image's path, shape) -> Measurement
        As for :func:`evaluate_presses`.
    ledger : Ledger, optional
        Holds what was measured before.
    """
    key = None if ledger is None else ledger.key(path, shape)
    if ledger is not None and key is not None:
        known = ledger.find(key)
        if known is not None:
            return known
    outcome: Measurement | str
    try:
        outcome = measure(path, shape)
    except InputError as error:  # a failed press is a result of the evaluation and does not stop it
        outcome = error.text
    if ledger is not None and key is not None:
        ledger.keep(key, outcome)
    return outcome
