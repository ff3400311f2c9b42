"""Validation of a calibration on an object of known size: part of the calibration's file.

It belongs to one calibration only, given by its identity. Older programs wrote it to a file next to
the calibration, ``<name>.validation.json``, which is read as long as the calibration's file has
none.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from gelpolight_core.base.compared_quantity import COVERAGE, REFERENCE, REST, SOURCES, Quantity
from gelpolight_core.base.errors import InputError
from gelpolight_core.base.finding import QualityTable, Verdict
from gelpolight_core.base.safe_reading import parse_time, plain_text, read_program_file, short_repr

FORMAT = "gelpolight-validation"
VERSION = 1
ENDING = ".validation.json"
WORDS = {
    Verdict.PASS: "Validated",
    Verdict.WARN: "Validation not decidable",
    Verdict.FAIL: "Validation failed",
}
"""Whether a calibration is validated, from the worst decision on a length."""
SMALLER = {
    "calibration": "capture more images for the scale",
    "noise": "use more light",
    REFERENCE: "state a more exact reference",
    REST: "press again with a clean object",
}
"""What makes each part of an uncertainty smaller, as far as something does."""
BALLS = "press more balls for the calibration"
"""The same for the calibration's part of a height."""


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
        At least one, with its true value and tolerance; its name, such as ``height``, has no unit.
    """

    identity: str
    when: str
    who: str
    indenter: str
    comparisons: tuple[Quantity, ...]

    @property
    def verdict(self) -> Verdict:
        """The worst decision on a length."""
        return worst_decision(self.comparisons)

    @property
    def passed(self) -> bool:
        """Whether all lengths conform."""
        return self.verdict is Verdict.PASS

    @property
    def largest_percent(self) -> float:
        """The largest error of a length, without its sign."""
        return max(abs(c.error_percent or 0.0) for c in self.comparisons)

    @property
    def basis(self) -> str:
        """How often and on how many objects, such as "2 presses of 1 object"."""
        heights = sum(compared.label == "height" for compared in self.comparisons)
        presses = max(heights, len(self.comparisons) - heights)
        objects = 1 + self.indenter.count(";")
        return f"{presses} press{'es' * (presses > 1)} of {objects} object{'s' * (objects > 1)}"

    @property
    def what_decides(self) -> str:
        """What would decide the length with the largest uncertainty. Empty if all are decided."""
        undecided = {
            100.0 * c.deviation_expanded / c.truth: c
            for c in self.comparisons
            if c.verdict is Verdict.WARN and c.truth is not None
        }
        if not undecided:
            return ""
        percent, compared = max(undecided.items(), key=lambda item: item[0])
        part, _ = max(compared.budget, key=lambda row: row[1])
        is_depth = part == "calibration" and compared.label == "height"
        action = BALLS if is_depth else SMALLER.get(part, "")
        # Rounded up: a tolerance of this value must be enough.
        enough = math.ceil(10.0 * (abs(compared.error_percent or 0.0) + percent)) / 10.0
        return (
            f"The uncertainty of the {compared.label} is ± {percent:.2g} % (k = {COVERAGE:g}), "
            f"the tolerance {compared.limit_percent:g} %. Its largest part is the "
            f"{SOURCES.get(part, part)}{action and f': {action}'}. "
            f"A tolerance of {enough:g} % can be decided."
        )

    def lines(self) -> list[str]:
        """Return it in words: verdict, object and origin, each length, and what would decide."""
        time = parse_time(self.when)
        day = self.when if time is None else f"{time.astimezone():%Y-%m-%d %H:%M}"
        by = f" by {self.who}" if self.who else ""
        lines = [f"{WORDS[self.verdict]}: {self.indenter}, {day}{by}"]
        lines += [compared.sentence for compared in self.comparisons]
        return [*lines, self.what_decides] if self.what_decides else lines

    def as_json(self) -> dict[str, Any]:
        """Return the validation as plain values."""
        rows = [
            {
                "quantity": c.name,
                "measured_mm": c.value,
                "true_mm": c.truth,
                "limit_percent": c.limit_percent,
                "sd_mm": c.sd,
                "true_sd_mm": c.truth_sd,
                "parts_mm": dict(c.parts),
                "en": c.en,
            }
            for c in self.comparisons
        ]
        return {**asdict(self), "comparisons": rows, "passed": self.passed}


def worst_decision(comparisons: Sequence[Quantity]) -> Verdict:
    """Return the worst decision on lengths, a failure where one is missing or not judged."""
    judged = tuple(compared.finding for compared in comparisons if compared.finding is not None)
    is_complete = judged and len(judged) == len(comparisons)
    return QualityTable(judged).verdict if is_complete else Verdict.FAIL


def validation_path(calibration: Path) -> Path:
    """Return where older programs wrote the validation of a calibration file."""
    return calibration.with_name(calibration.stem + ENDING)


def validation_in(manifest: Mapping[str, Any], path: Path) -> Validation | None:
    """Return the validation of a calibration, or None.

    Parameters
    ----------
    manifest : mapping
        Manifest of the calibration file.
    path : Path
        The file. A validation by an older program lies next to it.

    Raises
    ------
    ValueError, TypeError, KeyError
        If the one in the manifest is no validation.
    """
    validation = None
    if "validation" in manifest:
        validation = _parse(manifest["validation"])
    else:
        # With a damaged one the calibration is not validated, and is shown so.
        with suppress(InputError):
            beside = validation_path(path)
            validation = read_program_file(beside, (FORMAT, VERSION), _parse, found="({error})")
    return validation if validation and validation.identity == manifest["identity"] else None


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
                _sd(c.get("sd_mm")),
                _positive(c["true_mm"]),
                _positive(c["limit_percent"]),
                _sd(c.get("true_sd_mm")),
                tuple((plain_text(n), _sd(sd) or 0.0) for n, sd in c.get("parts_mm", {}).items()),
            )
            for c in content["comparisons"]
        ),
    )
    if content["passed"] is not validation.passed:
        raise ValueError("its verdict does not match its lengths")
    return validation


def _sd(value: Any) -> float | None:
    return None if value is None else 0.0 if value == 0 else _positive(value)


def _positive(value: Any) -> float:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    if not is_number or not 0.0 < value < 1e15:
        raise ValueError(f"{short_repr(value)} is not a length")
    return float(value)
