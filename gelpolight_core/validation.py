"""Validation of a calibration on an object of known size: part of the calibration's file.

It belongs to one calibration only, given by its identity. Older programs wrote it to a file next to
the calibration, ``<name>.validation.json``, which is read as long as the calibration's file has
none.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from gelpolight_core.errors import InputError
from gelpolight_core.io.reading import brief, parse_time, plain_text, read_own
from gelpolight_core.quantity import Quantity
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

    def lines(self) -> list[str]:
        """Return it in words: its verdict, object and origin, then each length."""
        word = tr("Validated") if self.passed else tr("Validation failed")
        time = parse_time(self.when)
        day = self.when if time is None else f"{time.astimezone():%Y-%m-%d %H:%M}"
        by = tr("by {name}").format(name=self.who) if self.who else ""
        line = tr("{what}: {a:.3f} mm measured, {b:.3f} mm true, {e:+.1f} % (limit {l:g} %)")
        return [
            f"{word}: {self.indenter}, {day} {by}".rstrip(),
            *(
                line.format(what=c.name, a=c.value, b=c.truth, e=c.error_percent, l=c.limit_percent)
                for c in self.comparisons
            ),
        ]

    def as_json(self) -> dict[str, Any]:
        """Return the validation as plain values."""
        keys = ("quantity", "measured_mm", "true_mm", "limit_percent")
        lengths = [(c.name, c.value, c.truth, c.limit_percent) for c in self.comparisons]
        rows = [dict(zip(keys, length, strict=True)) for length in lengths]
        return {**asdict(self), "comparisons": rows, "passed": self.passed}


def validation_path(calibration: Path) -> Path:
    """Return where older programs wrote the validation of a calibration file."""
    return calibration.with_name(calibration.stem + ENDING)


def validation_in(manifest: Mapping[str, Any], path: Path) -> Validation | None:
    """Return the validation of a calibration; None if there is none.

    Parameters
    ----------
    manifest : mapping
        Of the calibration file.
    path : Path
        The file. A validation by an older program lies next to it.

    Raises
    ------
    ValueError, TypeError, KeyError
        If the one in the manifest is no validation.
    """
    found = None
    if "validation" in manifest:
        found = _parse(manifest["validation"])
    else:
        # With a damaged one the calibration is not validated, and is shown so.
        with suppress(InputError):
            found = read_own(validation_path(path), (FORMAT, VERSION), _parse, found="({error})")
    return found if found is not None and found.identity == manifest["identity"] else None


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
