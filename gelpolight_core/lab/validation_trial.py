"""A trial of a calibration: presses of objects of known size, compared with their true values."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from gelpolight_core.base.compared_quantity import Quantity
from gelpolight_core.base.finding import Verdict
from gelpolight_core.base.store import Store
from gelpolight_core.base.user_name import user_name
from gelpolight_core.calibration.manifest import CalibrationSummary
from gelpolight_core.session.file_hashes import file_hash
from gelpolight_core.session.reference_object import SHAPES, ReferenceObject
from gelpolight_core.session.validation import Validation, worst_decision

from .measurement_record import DOUBTFUL, FILE, MeasurementRecord
from .reference_press import ReferencePress


def object_name(truth: ReferenceObject) -> str:
    """Return the name of an object, such as ``Cylinder, 5 mm``."""
    return f"{SHAPES[truth.shape]}, {truth.size_mm:g} mm"


def compared_lengths(
    press: ReferencePress, limits_percent: tuple[float, float]
) -> tuple[Quantity, ...]:
    """Return the measured lengths of a press whose true value is stated."""
    quantities = press.quantities(limits_percent).values()
    return tuple(replace(size, name=size.label) for size in quantities if size.truth is not None)


def validate(
    presses: Sequence[ReferencePress], identity: str, limits_percent: tuple[float, float]
) -> Validation:
    """Return the validation of a calibration from its measured presses.

    Parameters
    ----------
    presses : sequence of ReferencePress
        All presses of the trial; those without a measurement are left out.
    identity : str
        Identity of the calibration.
    limits_percent : (float, float)
        Tolerances of size and height.
    """
    objects = dict.fromkeys(object_name(press.truth) for press in presses)
    comparisons = (q for press in presses for q in compared_lengths(press, limits_percent))
    return _validation(identity, objects, comparisons)


def recorded_validation(
    store: Store, calibration: CalibrationSummary, limits_percent: tuple[float, float]
) -> tuple[Validation | None, str]:
    """Return the validation of a calibration from its saved measurements, and what does not count.

    A measurement counts if it is of an object of stated size, is not doubtful, and its image is
    a file that the calibration was not made from. Whether it conforms makes no difference. How
    many do not count, and why, is empty if all of this sensor do.

    Parameters
    ----------
    store : Store
        The lab's records.
    calibration : CalibrationSummary
        The calibration.
    limits_percent : (float, float)
        Tolerances of size and height.

    Raises
    ------
    InputError
        If the records or an image cannot be read.
    """
    objects, comparisons = dict[str, None](), list[Quantity]()
    refused = Counter[str]()
    for record in store.all(MeasurementRecord, serial=calibration.serial):
        compared = [q for q in record.quantities if q.truth is not None]
        if fault := _why_not_counted(record, calibration):
            refused[fault] += 1
        else:
            sizes = ", ".join(f"{q.label} {q.truth:g} mm" for q in compared)
            objects[f"{SHAPES[record.shape]}, {sizes}"] = None
            for q in compared:
                limit = limits_percent[q.label == "height"]
                comparisons.append(replace(q, name=q.label, limit_percent=limit))
    why = ", ".join(f"{count} {fault}" for fault, count in refused.items())
    return _validation(calibration.identity, objects, comparisons) if comparisons else None, why


def _why_not_counted(record: MeasurementRecord, calibration: CalibrationSummary) -> str:
    file = Path(str(record.settings.get(FILE, "")))
    if record.calibration_id != calibration.identity:
        return "measured with another calibration"
    if record.shape not in SHAPES or all(q.truth is None for q in record.quantities):
        return "not of an object of stated size"
    if record.verdict == DOUBTFUL:
        return "doubtful"
    if not file.is_file():
        return "without an image file"
    return "with an image of the calibration" * (file_hash(file) in calibration.sources)


def _validation(
    identity: str, objects: Iterable[str], comparisons: Iterable[Quantity]
) -> Validation:
    """Return a validation that is made now."""
    now, names = datetime.now(UTC).isoformat(timespec="seconds"), "; ".join(objects)
    return Validation(identity, now, user_name(), names, tuple(comparisons))


def is_recordable(presses: Iterable[ReferencePress], validation: Validation) -> bool:
    """Return whether to record a trial: all its measurements are reliable, or it has failed.

    Parameters
    ----------
    presses : iterable of ReferencePress
        All presses of the trial, measured.
    validation : Validation
        From them.
    """
    trusted = all(press.measurement and press.measurement.verdict == "ok" for press in presses)
    failed = bool(validation.comparisons) and validation.verdict is Verdict.FAIL
    return trusted or failed


def press_lines(press: ReferencePress, limits_percent: tuple[float, float]) -> tuple[str, str]:
    """Return the measured lengths of a press as text, with the role of the text."""
    measurement = press.measurement
    if measurement is None:
        return str(press.outcome), "warn"
    comparisons = compared_lengths(press, limits_percent)
    rows = [*(q.sentence for q in comparisons), *(f.line for f in press.truth.findings())]
    if measurement.verdict == "ok":
        return "\n".join(rows), worst_decision(comparisons).value
    rows.append(f"Low confidence: {measurement.reason}. Retake this press or leave it out.")
    return "\n".join(rows), "warn"
