"""How good something is: a value or a fault, its limits, a verdict, and the remedy."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from .errors import InputError

FILE_NAME = re.compile(r"\S+\.\w+[:\s]|[^:]+\.\w+:")
"""A name of a file at the start of a text: one word, or all before a colon."""
TINY = 1e-9
"""Rounding error only: no figure's limit is this close to 0."""


class Verdict(StrEnum):
    """How a figure, a stage or a calibration is judged."""

    PASS = "pass"
    WARN = "warn"
    FAIL = "fail"

    @property
    def word(self) -> str:
        """The verdict as it is shown."""
        return {"pass": "Pass", "warn": "Warning", "fail": "Fail"}[self]

    @property
    def sign(self) -> str:
        """A symbol beside it, so that it is not shown by colour alone."""
        return {"pass": "\N{CHECK MARK}", "warn": "!", "fail": "\N{MULTIPLICATION X}"}[self]


class HeightReliability(StrEnum):
    """What a finding says about the heights of a map."""

    STATED = "stated"
    """They are as exact as stated."""
    DOUBTFUL = "doubtful"
    """They may be wrong by more than stated."""
    MEANINGLESS = "meaningless"
    """They mean nothing."""


@dataclass(frozen=True, slots=True)
class Finding:
    """How good something is: a number of a stage, an image, a height map, a measurement.

    Attributes
    ----------
    key : str
        Name for scripts, such as ``reprojection_rms``.
    text : str
        Name of the number, or what was found, as a clause without a full stop.
    value : float
        In `unit`; NaN if there is no number.
    unit : str
        Such as ``px``, ``mm``, ``deg``, ``%``; empty for a count.
    warn_limit, fail_limit : float or None
        Values at which the verdict changes; None if there is no limit.
    verdict : Verdict
        The judgement.
    remedy : str
        What to do when the verdict is not "pass", as a sentence without a full stop.
    heights : HeightReliability
        What it says about the heights of a map.
    """

    key: str
    text: str
    value: float = math.nan
    unit: str = ""
    warn_limit: float | None = None
    fail_limit: float | None = None
    verdict: Verdict = Verdict.PASS
    remedy: str = ""
    heights: HeightReliability = HeightReliability.STATED

    def __eq__(self, other: object) -> bool:
        """Compare as tuples do: a NaN is equal to itself."""
        if not isinstance(other, Finding):
            return NotImplemented
        ours, theirs = ([getattr(one, name) for name in self.__slots__] for one in (self, other))
        return ours == theirs

    @property
    def stated(self) -> str:
        """Text, value and unit."""
        return self.text if math.isnan(self.value) else f"{self.text}: {self.value_text}"

    @property
    def value_text(self) -> str:
        """The value with its unit. Counts have no decimals."""
        if not math.isfinite(self.value):
            return "unknown"
        whole = abs(self.value) >= 1000.0 or (not self.unit and self.value == round(self.value))
        value = 0.0 if abs(self.value) < TINY else self.value
        return _with_unit(f"{value:{'.0f' if whole else '.3g'}}", self.unit)

    @property
    def limit_text(self) -> str:
        """The limit up to which it passes, such as "≤ 0.3 px". Empty if it has none."""
        limit = self.warn_limit if self.warn_limit is not None else self.fail_limit
        sign = "≥" if self.higher_is_better else "≤"
        return "" if limit is None else _with_unit(f"{sign} {limit:.4g}", self.unit)

    @property
    def line(self) -> str:
        """Text and remedy as sentences."""
        return _sentences(self.text, self.remedy)

    @property
    def sentence(self) -> str:
        """Text with its value, and remedy, as sentences."""
        return _sentences(self.stated, self.remedy)

    @property
    def meaningless(self) -> bool:
        """Whether heights mean nothing."""
        return self.heights is HeightReliability.MEANINGLESS

    @property
    def doubtful(self) -> bool:
        """Whether heights may be wrong by more than stated."""
        return self.heights is not HeightReliability.STATED

    def as_row(self) -> dict[str, Any]:
        """Return a judged number as plain values, with the keys of files."""
        return {
            "key": self.key,
            "label": self.text,
            "value": self.value,
            "unit": self.unit,
            "warn_limit": self.warn_limit,
            "fail_limit": self.fail_limit,
            "verdict": self.verdict.value,
            "advice": self.remedy,
        }

    @property
    def higher_is_better(self) -> bool:
        """Whether small values are bad, from the order of the limits or from the verdict."""
        limits = [x for x in (self.warn_limit, self.fail_limit) if x is not None]
        if len(limits) == 2 and limits[0] != limits[1]:
            return limits[0] > limits[1]
        if not limits:
            return False
        return (self.value <= limits[0]) != (self.verdict is Verdict.PASS)


def doubtful_finding(key: str, text: str) -> Finding:
    """Return a finding that makes heights, or what is measured on them, doubtful."""
    return Finding(key, text, verdict=Verdict.WARN, heights=HeightReliability.DOUBTFUL)


def join_reasons(findings: Iterable[Finding]) -> str:
    """Return why something is doubtful, as the texts of all findings."""
    return "; ".join(finding.text for finding in findings)


def _with_unit(number: str, unit: str) -> str:
    return f"{number}\N{DEGREE SIGN}" if unit == "deg" else f"{number} {unit}".rstrip()


def _sentences(text: str, remedy: str) -> str:
    # A file name keeps its letters.
    first = text[:1] if FILE_NAME.match(text) else text[:1].upper()
    text = (first + text[1:]).rstrip(". ")
    return ". ".join((text, remedy)).rstrip(". ") + "." if text or remedy else ""


def finding_from_error(error: InputError) -> Finding:
    """Return the finding of an error, without its `where` part."""
    return Finding("refused", error.found, verdict=Verdict.FAIL, remedy=error.advice)


def judge(
    key: str,
    text: str,
    value: float,
    unit: str = "",
    *,
    warn: float | None = None,
    fail: float | None = None,
    remedy: str = "",
    higher_is_better: bool = False,
) -> Finding:
    """Judge a value against its limits. A value that is not finite fails.

    Parameters
    ----------
    key, text, unit, remedy : str
        As in :class:`Finding`.
    value : float
        The measured value.
    warn, fail : float, optional
        Limits of the verdicts "warn" and "fail" (lower limits if `higher_is_better`).
    higher_is_better : bool, optional
        Whether small values are bad.
    """
    sign = -1.0 if higher_is_better else 1.0

    def beyond(limit: float | None) -> bool:
        return limit is not None and sign * value > sign * limit

    if not math.isfinite(value) or beyond(fail):
        verdict = Verdict.FAIL
    else:
        verdict = Verdict.WARN if beyond(warn) else Verdict.PASS
    return Finding(key, text, float(value), unit, warn, fail, verdict, remedy)


def worst_of(findings: Iterable[Finding]) -> Finding | None:
    """Return the first finding with the worst verdict, or None if all pass."""
    poor = [finding for finding in findings if finding.verdict is not Verdict.PASS]
    return max(poor, key=lambda finding: list(Verdict).index(finding.verdict), default=None)


def judge_excluded_images(key: str, text: str, reasons: Sequence[str]) -> Finding:
    """Judge how many images were left out.

    Parameters
    ----------
    key, text : str
        As in :class:`Finding`.
    reasons : sequence of str
        Name of each excluded image, with the reason.
    """
    return judge(key, text, len(reasons), warn=0.0, remedy=f"Left out: {'; '.join(reasons)}")


@dataclass(frozen=True, slots=True)
class QualityTable:
    """The quality figures of one stage, in display order."""

    figures: tuple[Finding, ...] = ()

    @property
    def verdict(self) -> Verdict:
        """The worst verdict of all figures."""
        worst = worst_of(self.figures)
        return Verdict.PASS if worst is None else worst.verdict

    @property
    def remedies(self) -> tuple[str, ...]:
        """Remedies of the figures that did not pass, each of them once."""
        remedies = (f.remedy for f in self.figures if f.verdict is not Verdict.PASS and f.remedy)
        return tuple(dict.fromkeys(remedies))

    def __getitem__(self, key: str) -> Finding:
        """Return the figure named `key`."""
        for figure in self.figures:
            if figure.key == key:
                return figure
        raise KeyError(key)

    def as_rows(self) -> list[dict[str, Any]]:
        """Return the table as plain values for JSON."""
        return [figure.as_row() for figure in self.figures]


def join_quality_tables(tables: Iterable[QualityTable]) -> QualityTable:
    """Return one table with the figures of several."""
    return QualityTable(tuple(figure for table in tables for figure in table.figures))


def calibration_fault(quality: Mapping[str, QualityTable]) -> Finding | None:
    """Return the finding of all height maps of a failed calibration, or None.

    A calibration with warnings is within the limits in which its stated uncertainties hold.

    Parameters
    ----------
    quality : mapping of str to QualityTable
        The quality figures of every stage.
    """
    figures = join_quality_tables(quality.values()).figures
    failed = [figure.stated for figure in figures if figure.verdict is Verdict.FAIL]
    if not failed:
        return None
    text = f"the calibration failed its quality check ({', '.join(failed)})"
    return Finding("calibration", text, verdict=Verdict.FAIL, heights=HeightReliability.DOUBTFUL)
