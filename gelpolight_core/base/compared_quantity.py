"""A measured value beside its true value: deviation, uncertainty budget, En and decision.

Every comparison with a reference asks this module: the Measure page, ``gelpolight measure`` and
``evaluate``, validations, records and reports. It does without the numerical libraries.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

from .finding import Finding, Verdict, judge

COVERAGE = 2.0
"""Coverage factor k of expanded uncertainties: about 95 % of a normal distribution."""
PAPER_PERCENT = {"planar": 5.0, "depth": 8.0}
"""Mean errors that the paper reports for random regions: the default tolerances."""
TOLERANCE_PERCENT = (PAPER_PERCENT["planar"], PAPER_PERCENT["depth"])
"""Default tolerances of size and height."""
REST, REFERENCE = "fit", "reference"
"""Rows of a budget: what the parts leave of the standard deviation, and the reference."""
SOURCES = {"model": "model and mode"}
"""Sources of a budget whose name says too little."""
DECISIONS = {
    Verdict.PASS: "conforms",
    Verdict.WARN: "not decidable",
    Verdict.FAIL: "does not conform",
}
"""The decisions of ISO 14253-1."""
SHORT_MM = 0.1
"""What is shorter is shown in micrometres: the digits of its mm begin with zeros."""
DECIMALS, MOST_DECIMALS = {"um": 1, "deg": 2, "%": 2, "percent": 2}, 4
"""Decimals of a value without a standard uncertainty by its unit, 3 of others; most with one."""
UNITS = {"um": "\N{MICRO SIGN}m", "deg": "°", "percent": "%"}
"""Units that are written in another way than in names."""


def readable_unit(*lengths_mm: float) -> tuple[str, float]:
    """Return the unit in which the longest of some lengths is readable, with units per mm."""
    return ("um", 1e3) if max(map(abs, lengths_mm)) < SHORT_MM else ("mm", 1.0)


def decimals_for(sd: float | None, unit: str) -> int:
    """Return the number of decimals of a value: two digits of its standard uncertainty."""
    default = DECIMALS.get(unit, 3)
    if sd is None or not math.isfinite(sd) or sd <= 0.0:
        return default
    decimals = max(1 - math.floor(math.log10(sd)), 0)
    return decimals if decimals <= MOST_DECIMALS else default


def unit_behind(unit: str) -> str:
    """Return a unit of a name as text after a number."""
    return UNITS[unit] if unit == "deg" else f" {UNITS.get(unit, unit)}"


def value_text(value: float, sd: float | None = None, unit: str = "mm", *, sign: str = "") -> str:
    """Return ``5.012 ± 0.024 mm``, or only the value without its sd.

    Parameters
    ----------
    value, sd : float
        The value and its standard or expanded uncertainty.
    unit : str, optional
        Their unit, as in names.
    sign : str, optional
        ``+`` to write the sign of positive values.
    """
    if not math.isfinite(value):
        return "unknown"
    if unit == "mm":
        unit, factor = readable_unit(value, sd or 0.0)
        value, sd = factor * value, sd and factor * sd
    decimals, uncertainty = decimals_for(sd, unit), ""
    if sd is not None and math.isfinite(sd):
        smallest = 10.0**-decimals
        uncertainty = f" ± {'<' if sd < 0.5 * smallest else ''}{max(sd, smallest):.{decimals}f}"
    return f"{value:{sign}z.{decimals}f}{uncertainty}{unit_behind(unit)}"


@dataclass(frozen=True, slots=True)
class Quantity:
    """A measured value, optionally with its true value and tolerance.

    Attributes
    ----------
    name : str
        Name with unit, such as ``diameter_mm``, ``height_mm`` or ``angle_deg``.
    value : float
        The measured value.
    sd : float or None
        Its standard uncertainty, if known.
    truth : float or None
        The true value, if known.
    limit_percent : float or None
        Tolerance: largest deviation that conforms, in percent of the truth.
    truth_sd : float or None
        Standard uncertainty of the true value; None if it is not stated, which counts as 0.
    parts : tuple of (str, float)
        Sources of `sd` and their standard uncertainties, as far as they are known.
    """

    name: str
    value: float
    sd: float | None = None
    truth: float | None = None
    limit_percent: float | None = None
    truth_sd: float | None = None
    parts: tuple[tuple[str, float], ...] = ()

    def __post_init__(self) -> None:
        """Refuse invalid numbers, and a true value of 0."""
        numbers = (self.value, self.sd, self.truth, self.limit_percent, self.truth_sd)
        if not all(number is None or math.isfinite(number) for number in numbers):
            raise ValueError(f"{self.name} holds a number that is not finite: {numbers}")
        if self.truth == 0.0:
            raise ValueError(f"{self.name} has a true value of 0")

    @property
    def unit(self) -> str:
        """The unit in its name, by default mm."""
        return self.name.rpartition("_")[2] if "_" in self.name else "mm"

    @property
    def label(self) -> str:
        """Its name without the unit."""
        return self.name.removesuffix(f"_{self.unit}").replace("_", " ")

    @property
    def text(self) -> str:
        """The value with its standard uncertainty."""
        return value_text(self.value, self.sd, self.unit)

    @property
    def error(self) -> float | None:
        """The deviation: measured minus true, in the quantity's unit."""
        return None if self.truth is None else self.value - self.truth

    @property
    def error_percent(self) -> float | None:
        """The deviation in percent of the truth."""
        return None if self.truth is None else percent_error(self.value, self.truth)

    @property
    def expanded(self) -> float | None:
        """Expanded uncertainty of the measured value (k = 2)."""
        return None if self.sd is None else COVERAGE * self.sd

    @property
    def truth_expanded(self) -> float | None:
        """Expanded uncertainty of the true value (k = 2)."""
        return None if self.truth_sd is None else COVERAGE * self.truth_sd

    @property
    def budget(self) -> tuple[tuple[str, float], ...]:
        """The standard uncertainty of the deviation by sources, whose squares add up (GUM 5.1)."""
        rows = self.parts
        if self.sd is not None:
            variance_left = self.sd**2 - sum(sd**2 for _, sd in rows)
            rows = (*rows, (REST, math.sqrt(max(variance_left, 0.0))))
        return rows if self.truth_sd is None else (*rows, (REFERENCE, self.truth_sd))

    @property
    def deviation_expanded(self) -> float:
        """Expanded uncertainty of the deviation: sqrt(U² + Uref²)."""
        return math.hypot(self.expanded or 0.0, self.truth_expanded or 0.0)

    @property
    def en(self) -> float | None:
        """The deviation over its expanded uncertainty, without sign (ISO/IEC 17043, B.3.1)."""
        if self.error is None or not self.sd:
            return None
        return abs(self.error) / self.deviation_expanded

    @property
    def finding(self) -> Finding | None:
        """The decision by the tolerance, or None without truth or tolerance."""
        if self.truth is None or self.error_percent is None or self.limit_percent is None:
            return None
        expanded = abs(100.0 * self.deviation_expanded / self.truth)
        text = f"Deviation of {self.label}"
        return guarded("deviation", text, abs(self.error_percent), self.limit_percent, expanded)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The decision, and En where the uncertainties do not explain what is not beyond it."""
        found = () if self.finding is None else (self.finding,)
        if self.en is None or self.en <= 1.0 or self.verdict in (None, Verdict.FAIL):
            return found
        remedy = "The deviation is larger than the uncertainties explain"
        return (*found, judge("en", f"En of {self.label}", self.en, warn=1.0, remedy=remedy))

    @property
    def verdict(self) -> Verdict | None:
        """Conforms ("pass"), not decidable ("warn"), does not ("fail"), or None if not judged."""
        return None if self.finding is None else self.finding.verdict

    @property
    def decision(self) -> str | None:
        """The verdict in words."""
        return None if self.verdict is None else DECISIONS[self.verdict]

    @property
    def judgement(self) -> str:
        """The decision with tolerance and En value, or "" if it is not judged."""
        if not self.decision:
            return ""
        en = "" if self.en is None else f", En {self.en:.2f}"
        doubts = (f". {finding.remedy}" for finding in self.findings[1:])
        return f"{self.decision}, tolerance {self.limit_percent:g} %{en}{''.join(doubts)}"

    @property
    def sentence(self) -> str:
        """The comparison as one line, all uncertainties with k = 2, or "" if it is not judged."""
        if self.verdict is None or self.truth is None:
            return ""
        percent = 100.0 * self.deviation_expanded / self.truth
        known = f" ± {percent:.2f} % (k = {COVERAGE:g})" if percent else ", uncertainty unknown"
        measured = value_text(self.value, self.expanded, self.unit)
        true = value_text(self.truth, unit=self.unit)
        return (
            f"{self.label.capitalize()}: measured {measured}, true {true}, "
            f"deviation {self.error_percent:+z.2f} %{known}: {self.judgement}"
        )

    def as_json(self) -> dict[str, Any]:
        """Return the comparison as plain values, with the unit in the quantity's name."""
        return {
            "quantity": self.name,
            "measured": self.value,
            "true": self.truth,
            "deviation": self.error,
            "deviation_percent": self.error_percent,
            "expanded": self.expanded,
            "true_expanded": self.truth_expanded,
            "deviation_expanded": self.deviation_expanded,
            "en": self.en,
            "tolerance_percent": self.limit_percent,
            "decision": self.decision,
            "budget": [{"source": source, "sd": sd} for source, sd in self.budget],
        }


def guarded(
    key: str, text: str, deviation: float, limit: float, expanded: float, *, remedy: str = ""
) -> Finding:
    """Judge a deviation in percent by ISO 14253-1.

    Within the tolerance less the uncertainty it conforms ("pass"), beyond the tolerance plus the
    uncertainty it does not ("fail"), and between the two nothing can be decided ("warn").

    Parameters
    ----------
    key, text, remedy : str
        As in :class:`~gelpolight_core.base.finding.Finding`.
    deviation, limit : float
        The deviation without sign, and the tolerance.
    expanded : float
        Expanded uncertainty of the deviation (k = 2).
    """
    finding = judge(
        key, text, deviation, "%", warn=limit - expanded, fail=limit + expanded, remedy=remedy
    )
    undecided = replace(finding, remedy="The uncertainty is too large to decide")
    return undecided if finding.verdict is Verdict.WARN else finding


def percent_error(measured: float, true: float) -> float:
    """Return the signed error in percent of the true value."""
    return 100.0 * (measured / true - 1.0)
