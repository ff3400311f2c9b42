"""Whether a calibration was tried on an object of known size: a small file beside it.

``<name>.validation.json`` says when and by whom, what was pressed in, what was measured and what is
true, and the limits. It counts for one calibration only, whose identity it names.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, BinaryIO

from gelpolight_core.errors import InputError
from gelpolight_core.export.atomic import write_atomically
from gelpolight_core.reading import NEWEST, brief, parse_json, plain_text, read_file
from gelpolight_core.translation import tr

FORMAT = "gelpolight-validation"
VERSION = 1
ENDING = ".validation.json"
SIZE_LIMIT = 1_000_000
# Percents of it are numbers still.
MOST = 1e15


@dataclass(frozen=True, slots=True)
class Comparison:
    """One length of the object: measured, true, and how far apart they may be.

    Attributes
    ----------
    quantity : str
        Such as ``height`` or ``diameter``.
    measured_mm, true_mm : float
        The two lengths.
    limit_percent : float
        Largest error for it to pass, in percent of the true length.
    """

    quantity: str
    measured_mm: float
    true_mm: float
    limit_percent: float

    @property
    def error_percent(self) -> float:
        """Measured minus true, in percent of the true length."""
        return 100.0 * (self.measured_mm - self.true_mm) / self.true_mm

    @property
    def passed(self) -> bool:
        """Whether the error is within the limit; never for a number that is not finite."""
        return abs(self.error_percent) <= self.limit_percent


@dataclass(frozen=True, slots=True)
class Validation:
    """A trial of a calibration on an object of known size.

    Attributes
    ----------
    identity : str
        Of the calibration that was tried.
    when : str
        ISO 8601 time with zone.
    who : str
        Who did it.
    indenter : str
        What was pressed in, for people.
    comparisons : tuple of Comparison
        At least one.
    """

    identity: str
    when: str
    who: str
    indenter: str
    comparisons: tuple[Comparison, ...]

    @property
    def passed(self) -> bool:
        """Whether every length is within its limit, and there is one."""
        return bool(self.comparisons) and all(c.passed for c in self.comparisons)


def validation_path(calibration: Path) -> Path:
    """Return where the validation of a calibration file is kept."""
    return calibration.with_name(calibration.stem + ENDING)


def write_validation(validation: Validation, calibration: Path) -> Path:
    """Write a validation beside its calibration file, whole or not at all; return its place.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    path = validation_path(calibration)
    content = {
        "format": FORMAT,
        "version": VERSION,
        **asdict(validation),
        "passed": validation.passed,
    }
    text = json.dumps(content, indent=1, allow_nan=False) + "\n"

    def write(stream: BinaryIO) -> None:
        stream.write(text.encode())

    write_atomically(path, write)
    return path


def read_validation(calibration: Path) -> Validation | None:
    """Read the validation beside a calibration file; None where there is none.

    Raises
    ------
    InputError
        If it is damaged, of a newer version, or says "passed" of lengths that do not.
    """
    path = validation_path(calibration)
    try:
        content = parse_json(read_file(path, SIZE_LIMIT))
        return _parse(content, path)
    except FileNotFoundError:
        return None
    except (ValueError, TypeError, KeyError, AttributeError, ArithmeticError) as error:
        raise InputError(
            tr("the validation cannot be read ({error})").format(error=brief(str(error), 200)),
            where=str(path),
            advice=tr("Validate the calibration again"),
        ) from error


def _parse(content: Any, path: Path) -> Validation:
    if not isinstance(content, Mapping) or content.get("format") != FORMAT:
        raise ValueError("it is not a validation")
    version = content["version"]
    if type(version) is int and VERSION < version < NEWEST:
        raise InputError(
            tr("the validation has version {v} and this program knows version {k}").format(
                v=version, k=VERSION
            ),
            where=str(path),
            advice=tr("Use a newer version of GelPoLight Studio"),
        )
    if version != VERSION:
        raise ValueError(f"version {version!r}")
    validation = Validation(
        identity=_text(content["identity"]),
        when=_text(content["when"]),
        who=_text(content["who"]),
        indenter=_text(content["indenter"]),
        comparisons=tuple(
            Comparison(
                _text(c["quantity"]),
                _positive(c["measured_mm"]),
                _positive(c["true_mm"]),
                _positive(c["limit_percent"]),
            )
            for c in content["comparisons"]
        ),
    )
    if content["passed"] is not validation.passed:
        raise ValueError("its verdict does not agree with its lengths")
    return validation


def _text(value: Any) -> str:
    return plain_text(value)


def _positive(value: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"{brief(value)} is no number")
    if not 0.0 < value < MOST:
        raise ValueError(f"{brief(value)} is no length")
    return float(value)
