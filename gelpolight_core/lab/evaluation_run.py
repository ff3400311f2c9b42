"""Measure the presses of a folder for an evaluation."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator
from dataclasses import replace
from functools import lru_cache, partial
from pathlib import Path

from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.calibration.calibration_file import read_calibration
from gelpolight_core.measurement.map_reliability import with_map_findings
from gelpolight_core.measurement.measurable_depth import measurable_depth
from gelpolight_core.measurement.object_measurement import measure_heightmap
from gelpolight_core.measurement.result import Measurement
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.file_hashes import file_hash
from gelpolight_core.session.reference_object import ReferenceObject
from gelpolight_core.session.session_images import read_colours

from .characteristics import flat_maps
from .evaluation import Evaluation, evaluate
from .reference_press import read_truth

MeasurementOrReason = Measurement | str
"""A measurement, or the sentence why there is none."""
NumberedPress = tuple[int, Path, ReferenceObject]
"""A row of the table, its image, and its object."""


def in_turn(
    function: Callable[[NumberedPress], MeasurementOrReason], presses: Iterable[NumberedPress]
) -> Iterator[tuple[NumberedPress, MeasurementOrReason | None]]:
    """Yield each press with its outcome."""
    return ((press, function(press)) for press in presses)


def press_measurement(
    reconstructor: Reconstructor,
) -> Callable[[Path, ReferenceObject], Measurement]:
    """Return the function that measures a given object in an image file.

    Parameters
    ----------
    reconstructor : Reconstructor
        With the calibration under test.
    """
    return lambda path, truth: measure_press(path, truth, reconstructor)[0]


def refuse_source(image: Path, sources: Collection[str]) -> None:
    """Refuse an image that a calibration was made from: it cannot validate that calibration.

    Parameters
    ----------
    image : Path
        Image of a press.
    sources : collection of str
        SHA-256 of each file that the calibration was made from.

    Raises
    ------
    InputError
        If it is one of them, or cannot be read.
    """
    if file_hash(image) in sources:
        raise InputError("This press was used for the calibration", image, Remedy.CAPTURE_AGAIN)


def measure_press(
    path: Path, truth: ReferenceObject, reconstructor: Reconstructor
) -> tuple[Measurement, HeightMap]:
    """Measure a given object in an image file: its shape, its edge. Return also its height map.

    Parameters
    ----------
    path : Path
        The image.
    truth : ReferenceObject
        What is pressed.
    reconstructor : Reconstructor
        With the calibration under test, whose verdict is part of the measurement's.

    Raises
    ------
    InputError
        If the calibration was made from the image, the image cannot be reconstructed, or no object
        is found in it.
    """
    image = read_colours(path, response=reconstructor.calibration.response)
    refuse_source(path, reconstructor.calibration.provenance.sources.values())
    heightmap = measurable_depth(reconstructor, image, where=str(path))
    edge_mm, edge_sd_mm = truth.edge_mm
    measurement = measure_heightmap(
        heightmap, shape=truth.shape, edge_radius_mm=edge_mm, edge_radius_sd_mm=edge_sd_mm
    )
    return with_map_findings(measurement, heightmap), heightmap


def evaluate_presses(
    folder: Path,
    measure: Callable[[Path, ReferenceObject], MeasurementOrReason],
    *,
    progress: Callable[[str, float], None] = lambda _name, _share: None,
    submit: Callable[
        [Callable[[NumberedPress], MeasurementOrReason], Iterable[NumberedPress]],
        Iterator[tuple[NumberedPress, MeasurementOrReason | None]],
    ] = in_turn,
    reconstructor: Reconstructor | None = None,
) -> Evaluation:
    """Measure every press of a folder with ``truth.csv`` and compare it with the truth.

    Parameters
    ----------
    folder : Path
        Images and ``truth.csv``.
    measure : callable (image's path, ReferenceObject) -> Measurement or str
        Such as :func:`press_measurement` returns.
    progress : callable, optional
        Called with the file name and the share done, 0..1.
    submit : callable, optional
        Yields presses with their outcomes in any order, as the method of
        :class:`~gelpolight_core.lab.batch.worker_pool.WorkerPool`; None where processes ended.
    reconstructor : Reconstructor, optional
        Reconstructor for the images of the untouched membrane in the folder ``flat``.

    Raises
    ------
    InputError
        ``truth.csv`` cannot be used, or a file it names is missing. An image that cannot be
        reconstructed or measured is a result with its reason instead.
    """
    table = read_truth(folder)
    missing = [row.file for row in table.rows if not (folder / row.file).is_file()]
    if missing:
        text = (
            f"{len(missing)} of {len(table.rows)} images are missing beside it, first {missing[0]}"
        )
        raise InputError(text, folder / "truth.csv", Remedy.TRUTH_ROW)
    presses = [(k, folder / row.file, row.truth) for k, row in enumerate(table.rows)]
    results: list[MeasurementOrReason] = ["Several processes ended while measuring it"] * len(
        presses
    )
    outcomes = submit(partial(_press_outcome, measure), presses)
    for done, (_, path, _) in enumerate(presses):
        progress(path.name, done / len(presses))
        (k, _, _), outcome = next(outcomes)
        results[k] = outcome or results[k]
    progress("", 1.0)
    evaluation = evaluate(table.rows, results, skipped=table.skipped)
    flat = () if reconstructor is None else flat_maps(reconstructor, folder)
    return replace(evaluation, flat_um=flat)


def measure_with(
    calibration: Path, model: str | None, image: Path, truth: ReferenceObject
) -> MeasurementOrReason:
    """Measure an image with a calibration file, which each process reads once."""
    return _measurement(calibration, model)(image, truth)


@lru_cache(maxsize=1)
def _measurement(
    calibration: Path, model: str | None
) -> Callable[[Path, ReferenceObject], MeasurementOrReason]:
    return press_measurement(Reconstructor(read_calibration(calibration), model=model, workers=1))


def _press_outcome(
    measure: Callable[[Path, ReferenceObject], MeasurementOrReason], press: NumberedPress
) -> MeasurementOrReason:
    """Measure the object in an image, or return as a sentence why it cannot be measured."""
    try:
        return measure(*press[1:])
    except InputError as error:  # a failed press is a result of the evaluation and does not stop it
        return str(error)
