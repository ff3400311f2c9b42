"""Quality figures: a measured value, its limits, a verdict, and advice."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from typing import Any

from gelpolight_core.translation import joined, pattern, tr

TINY = 1e-9
"""Rounding error only: no figure's limit is this close to 0."""


class Verdict(StrEnum):
    """How a figure, a stage or a calibration is judged."""

    PASS = "pass"
    WARN = "warn"
    FAIL = "fail"


_ORDER = (Verdict.PASS, Verdict.WARN, Verdict.FAIL)


@dataclass(frozen=True, slots=True)
class Figure:
    """One judged number of a stage.

    Attributes
    ----------
    key : str
        Name for scripts, such as ``reprojection_rms``.
    label : str
        Name shown to users.
    value : float
        In `unit`.
    unit : str
        Such as ``px``, ``mm``, ``deg``, ``%``; empty for a count.
    warn_limit, fail_limit : float or None
        Values at which the verdict changes; None if the figure is only reported.
    verdict : Verdict
        The judgement.
    advice : str
        What to do when the verdict is not "pass".
    """

    key: str
    label: str
    value: float
    unit: str
    warn_limit: float | None
    fail_limit: float | None
    verdict: Verdict
    advice: str

    @property
    def text(self) -> str:
        """Label, value and unit."""
        form = "{label}: {value:.3g} {unit}" if self.unit else "{label}: {value:.3g}"
        return pattern(form, label=self.label, value=self.value, unit=self.unit)

    @property
    def higher_is_better(self) -> bool:
        """Whether small values are bad, from the order of the limits or from the verdict."""
        limits = [x for x in (self.warn_limit, self.fail_limit) if x is not None]
        if len(limits) == 2 and limits[0] != limits[1]:
            return limits[0] > limits[1]
        if not limits:
            return False
        return (self.value <= limits[0]) != (self.verdict is Verdict.PASS)


def verdict_word(verdict: Verdict) -> str:
    """Return the label of a verdict."""
    return {
        Verdict.PASS: tr("Pass"),
        Verdict.WARN: tr("Warning"),
        Verdict.FAIL: tr("Fail"),
    }[verdict]


def value_text(figure: Figure) -> str:
    """Return a figure's value with its unit. Counts have no decimals."""
    if not math.isfinite(figure.value):
        return tr("unknown")
    if abs(figure.value) < TINY:
        number = "0"
    elif not figure.unit and figure.value == round(figure.value):
        number = f"{figure.value:.0f}"
    else:
        number = f"{figure.value:.3g}" if abs(figure.value) < 1000.0 else f"{figure.value:.0f}"
    return f"{number} {figure.unit}".rstrip()


def limit_text(figure: Figure) -> str:
    """Return the pass limit of a figure, such as "≤ 0.3 px". Empty if it has none."""
    limit = figure.warn_limit if figure.warn_limit is not None else figure.fail_limit
    if limit is None:
        return ""
    sign = "≥" if figure.higher_is_better else "≤"
    return f"{sign} {limit:.4g} {figure.unit}".rstrip()


def judge(
    key: str,
    label: str,
    value: float,
    unit: str = "",
    *,
    warn: float | None = None,
    fail: float | None = None,
    advice: str = "",
    higher_is_better: bool = False,
) -> Figure:
    """Judge a value against its limits; a value that is not finite fails.

    Parameters
    ----------
    key, label, unit, advice : str
        As in :class:`Figure`.
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
    return Figure(key, label, float(value), unit, warn, fail, verdict, advice)


def judge_left_out(key: str, label: str, reasons: Sequence[str]) -> Figure:
    """Judge how many images were left out.

    Parameters
    ----------
    key, label : str
        As in :class:`Figure`.
    reasons : sequence of str
        Of each image that was left out, its name and why.
    """
    advice = tr("Left out: {names}").format(names=joined("; ", reasons))
    return judge(key, label, len(reasons), warn=0.0, advice=advice)


@dataclass(frozen=True, slots=True)
class QualityTable:
    """The quality figures of one stage, in display order."""

    figures: tuple[Figure, ...] = ()

    @property
    def verdict(self) -> Verdict:
        """The worst verdict of all figures; "pass" when there are none."""
        return max((f.verdict for f in self.figures), key=_ORDER.index, default=Verdict.PASS)

    @property
    def advice(self) -> tuple[str, ...]:
        """What to do, for every figure that did not pass; each advice once."""
        wanted = (f.advice for f in self.figures if f.verdict is not Verdict.PASS and f.advice)
        return tuple(dict.fromkeys(wanted))

    def __getitem__(self, key: str) -> Figure:
        """Return the figure named `key`."""
        for figure in self.figures:
            if figure.key == key:
                return figure
        raise KeyError(key)

    def as_rows(self) -> list[dict[str, Any]]:
        """Return the table as plain values for JSON."""
        return [
            {
                "key": f.key,
                "label": f.label,
                "value": f.value,
                "unit": f.unit,
                "warn_limit": f.warn_limit,
                "fail_limit": f.fail_limit,
                "verdict": f.verdict.value,
                "advice": f.advice,
            }
            for f in self.figures
        ]


def worst_verdict(quality: Mapping[str, QualityTable]) -> Verdict:
    """Return the worst verdict of a calibration's stages."""
    return QualityTable(tuple(f for table in quality.values() for f in table.figures)).verdict


def failure(quality: Mapping[str, QualityTable]) -> str:
    """Return which figures of a calibration failed, as a clause; empty where none did.

    Parameters
    ----------
    quality : mapping of str to QualityTable
        Of every stage.
    """
    failed = [
        figure.text
        for table in quality.values()
        for figure in table.figures
        if figure.verdict is Verdict.FAIL
    ]
    if not failed:
        return ""
    return tr("the calibration failed its quality check ({figures})").format(
        figures=joined(", ", failed)
    )
