"""A trial of a calibration: presses of objects of known size, compared with their true values."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

from gelpolight_core.base.compared_quantity import Quantity
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import Verdict
from gelpolight_core.base.user_name import user_name
from gelpolight_core.session.file_hashes import file_hash
from gelpolight_core.session.reference_object import SHAPES, ReferenceObject
from gelpolight_core.session.validation import Validation, worst_decision

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
    return Validation(
        identity,
        datetime.now(UTC).isoformat(timespec="seconds"),
        user_name(),
        "; ".join(dict.fromkeys(object_name(press.truth) for press in presses)),
        tuple(q for press in presses for q in compared_lengths(press, limits_percent)),
    )


def is_recordable(presses: Iterable[ReferencePress], validation: Validation) -> bool:
    """Return whether to record a trial: all its measurements are reliable, or it has failed.

    Parameters
    ----------
    presses : iterable of ReferencePress
        All presses of the trial, measured.
    validation : Validation
        From them.
    """
    measured = [press.measurement for press in presses]
    trusted = all(
        measurement is not None and measurement.verdict == "ok" for measurement in measured
    )
    failed = bool(validation.comparisons) and validation.verdict is Verdict.FAIL
    return trusted or failed


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


def press_lines(press: ReferencePress, limits_percent: tuple[float, float]) -> tuple[str, str]:
    """Return the measured lengths of a press as text, with the role of the text."""
    measurement = press.measurement
    if measurement is None:
        return str(press.outcome), "warn"
    comparisons = compared_lengths(press, limits_percent)
    lines = [quantity.sentence for quantity in comparisons]
    rows = [line[:1].upper() + line[1:] for line in lines]
    rows += [finding.line for finding in press.truth.findings()]
    if measurement.verdict == "ok":
        return "\n".join(rows), worst_decision(comparisons).value
    rows.append(f"Low confidence: {measurement.reason}. Retake this press or leave it out.")
    return "\n".join(rows), "warn"
