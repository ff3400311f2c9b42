"""Validation of a calibration on an object of known size: a small file next to it.

``<name>.validation.json`` contains time, operator, object, measured and true lengths, and the
limits.
It belongs to one calibration only, given by its identity.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from gelpolight_core.io.atomic import write_json
from gelpolight_core.io.reading import brief, plain_text, read_own
from gelpolight_core.measurement.quantity import Quantity
from gelpolight_core.translation import tr

FORMAT = "gelpolight-validation"
VERSION = 1
ENDING = ".validation.json"


@dataclass(frozen=True, slots=True)
class Validation:
    """Validation of a calibration on an object of known size.

    Attributes
    ----------
    identity : str
        Identity of the calibration.
    when : str
        ISO 8601 time with zone.
    who : str
        The operator.
    indenter : str
        Description of the object for the user.
    comparisons : tuple of Quantity
        At least one, with its true value and limit; its name, such as ``height``, has no unit.
    """

    identity: str
    when: str
    who: str
    indenter: str
    comparisons: tuple[Quantity, ...]

    @property
    def passed(self) -> bool:
        """Whether there is at least one length and all are within their limits."""
        return bool(self.comparisons) and all(c.passed for c in self.comparisons)

    @property
    def largest_percent(self) -> float:
        """The largest error of a length, without its sign."""
        return max(abs(c.error_percent or 0.0) for c in self.comparisons)

    def as_json(self) -> dict[str, Any]:
        """Return the validation as plain values."""
        keys = ("quantity", "measured_mm", "true_mm", "limit_percent")
        lengths = [(c.name, c.value, c.truth, c.limit_percent) for c in self.comparisons]
        rows = [dict(zip(keys, length, strict=True)) for length in lengths]
        return {**asdict(self), "comparisons": rows}


def validation_path(calibration: Path) -> Path:
    """Return the path of the validation of a calibration file."""
    return calibration.with_name(calibration.stem + ENDING)


def write_validation(validation: Validation, calibration: Path) -> Path:
    """Write a validation next to its calibration file, completely or not at all. Return its path.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    path = validation_path(calibration)
    content = {
        "format": FORMAT,
        "version": VERSION,
        **validation.as_json(),
        "passed": validation.passed,
    }
    write_json(path, content)
    return path


def read_validation(calibration: Path) -> Validation | None:
    """Read the validation next to a calibration file. None if there is none.

    Raises
    ------
    InputError
        If it is damaged, has a newer version, or its verdict does not match its lengths.
    """
    return read_own(
        validation_path(calibration),
        (FORMAT, VERSION),
        _parse,
        found=tr("The validation cannot be read ({error})"),
    )


def _parse(content: Any) -> Validation:
    validation = Validation(
        identity=plain_text(content["identity"]),
        when=plain_text(content["when"]),
        who=plain_text(content["who"]),
        indenter=plain_text(content["indenter"]),
        comparisons=tuple(
            Quantity(
                plain_text(c["quantity"]),
                _positive(c["measured_mm"]),
                truth=_positive(c["true_mm"]),
                limit_percent=_positive(c["limit_percent"]),
            )
            for c in content["comparisons"]
        ),
    )
    if content["passed"] is not validation.passed:
        raise ValueError("its verdict does not match its lengths")
    return validation


def _positive(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"{brief(value)} is not a number")
    if not 0.0 < value < 1e15:
        raise ValueError(f"{brief(value)} is not a length")
    return float(value)
