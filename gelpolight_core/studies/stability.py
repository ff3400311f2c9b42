"""Extreme cases: each must be correct or be refused with its reason.

A case is a function that returns what each mode made of it. An :class:`InputError` counts as
refused, and so does a wrong result that reports that it is not reliable. Any other exception is a
failure of the program; the run continues and the table shows it.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any

from gelpolight_core.base.atomic_write import write_files
from gelpolight_core.base.csv_table import csv_from_dicts
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.output.drawing_thread import Figure
from gelpolight_core.output.report.drawing_tools import png
from gelpolight_core.reconstruction.trace import EFFORTS

MODES = (*reversed(EFFORTS), "paper")


class CaseOutcome(StrEnum):
    """How a case ended."""

    PASSED = "passed"
    REFUSED = "refused"
    FAILED = "failed"


@dataclass(frozen=True, slots=True)
class ModeResult:
    """Result of one mode in a case.

    Attributes
    ----------
    name : str
        One of `MODES`; empty where a case has no modes.
    right : bool
        Whether it meets all requirements; a result that is not finite never does.
    error_um : float or None
        Root mean square error of the depth; None without truth.
    bound_um : float
        The largest accepted error.
    warning : str
        What the result reports if it is not reliable; otherwise empty.
    """

    name: str
    right: bool
    error_um: float | None = None
    bound_um: float = math.inf
    warning: str = ""


@dataclass(frozen=True, slots=True)
class CaseMeasurement:
    """What a case showed: a summary, and the result of each mode.

    Attributes
    ----------
    summary : str
        What happened, without a full stop.
    modes : tuple of ModeResult
        What each mode made of it; the first one is shown. The case ends as the worst of them.
    flags : str
        The flags that were set, each with its share of the nodes.
    condition : float or None
        Largest condition number of the light directions.
    """

    summary: str
    modes: tuple[ModeResult, ...]
    flags: str = ""
    condition: float | None = None


@dataclass(frozen=True, slots=True)
class Case:
    """One extreme case.

    Attributes
    ----------
    subject, name : str
        The group that it belongs to, and its name on the command line.
    required : str
        What is done to all cases of its kind, and the required result.
    run : callable
        Does it.
    """

    subject: str
    name: str
    required: str
    run: Callable[[], CaseMeasurement]


def cases_of(
    table: Mapping[tuple[str, str], Mapping[str, Callable[[], CaseMeasurement]]],
) -> tuple[Case, ...]:
    """Return the cases of a table of names and runs by subject and requirement."""
    return tuple(
        Case(subject, name, required, run)
        for (subject, required), runs in table.items()
        for name, run in runs.items()
    )


@dataclass(frozen=True, slots=True)
class CaseResult:
    """How a case ended, with what it showed and its run time.

    Attributes
    ----------
    case : Case
        What was done.
    outcome : CaseOutcome
        How it ended.
    message : str
        What happened, with the reason of a refusal.
    seen : CaseMeasurement
        Without modes where the case was refused or raised an error.
    seconds : float
        Run time of the whole case, its rendering included.
    """

    case: Case
    outcome: CaseOutcome
    message: str
    seen: CaseMeasurement
    seconds: float

    @property
    def first(self) -> ModeResult:
        """The first mode, which is shown, or one without numbers where there is none."""
        return self.seen.modes[0] if self.seen.modes else ModeResult("", False)

    @property
    def row(self) -> dict[str, Any]:
        """One row of the table."""
        errors = {mode.name: mode.error_um for mode in self.seen.modes}
        return {
            "subject": self.case.subject,
            "case": self.case.name,
            "required": self.case.required,
            "verdict": self.outcome.value,
            "error_um": self.first.error_um,
            "bound_um": self.first.bound_um if math.isfinite(self.first.bound_um) else None,
            **{f"{name}_um": errors.get(name) for name in MODES},
            "flags": self.seen.flags,
            "condition": self.seen.condition,
            "seconds": round(self.seconds, 3),
            "message": self.message,
        }

    @property
    def line(self) -> str:
        """The result as one line of text."""
        error = "" if self.first.error_um is None else f"{self.first.error_um:.3g} um"
        start = f"{self.outcome.value:<8} {self.case.name:<32}{error:>12}"
        return f"{start}{self.seconds:7.1f} s  {self.message}"


def single_measurement(
    right: bool, summary: str, *, error_um: float | None = None, bound_um: float = math.inf
) -> CaseMeasurement:
    """Return the measurement of a case without modes, wrong beyond its error bound."""
    within = error_um is None or error_um <= bound_um
    return CaseMeasurement(summary, (ModeResult("", right and within, error_um, bound_um),))


def run_case(case: Case) -> CaseResult:
    """Run one case and return its result, also for an exception."""
    begin = time.perf_counter()
    measurement = CaseMeasurement("", ())
    try:
        measurement = case.run()
        outcome, message = _outcome(measurement)
    except InputError as error:
        outcome, message = CaseOutcome.REFUSED, str(error).rstrip(".")
    except Exception as error:  # the table must show faults of the program
        outcome, message = CaseOutcome.FAILED, f"{type(error).__name__}: {error}"
    return CaseResult(case, outcome, message, measurement, time.perf_counter() - begin)


def _outcome(measurement: CaseMeasurement) -> tuple[CaseOutcome, str]:
    wrong = [mode for mode in measurement.modes if not mode.right]
    silent = [mode.name for mode in wrong if not mode.warning]
    if silent:
        return (
            CaseOutcome.FAILED,
            f"{measurement.summary}; wrong without a note: {', '.join(silent)}",
        )
    warnings = dict.fromkeys(mode.warning for mode in wrong)
    return CaseOutcome.REFUSED if wrong else CaseOutcome.PASSED, "; ".join(
        [measurement.summary, *warnings]
    )


def chosen_cases(cases: Sequence[Case], names: str | None) -> tuple[Case, ...]:
    """Return the cases with the given names or subjects, separated by commas, by default all.

    Raises
    ------
    InputError
        If there is no such case.
    """
    if names is None:
        return tuple(cases)
    requested = [name.strip() for name in names.split(",")]
    existing = {case.name for case in cases} | {case.subject for case in cases}
    for name in requested:
        if name not in existing:
            advice = Remedy.ONE_OF.format(names=", ".join(sorted(existing)))
            raise InputError(f"there is no case {name!r}", "--only", advice)
    return tuple(case for case in cases if case.name in requested or case.subject in requested)


def summary_line(results: Iterable[CaseResult]) -> str:
    """Return the number of cases with each outcome."""
    outcomes = [result.outcome for result in results]
    passed, refused, failed = (outcomes.count(outcome) for outcome in CaseOutcome)
    counts = f"{passed} passed, {refused} refused with the reason, {failed} failed"
    return f"{counts}, of {len(outcomes)}"


def write_stability(results: Sequence[CaseResult], folder: Path) -> tuple[Path, ...]:
    """Write ``stability.csv`` and ``stability.png``: the error of each case with its limit.

    Raises
    ------
    InputError
        If a file cannot be written.
    """
    drawn = [result for result in results if result.first.error_um]
    image = png(lambda figure: _paint(figure, drawn), 9.0, 1.5 + 0.14 * len(drawn))
    table = csv_from_dicts([result.row for result in results]).encode()
    return write_files(folder, {"stability.csv": table, "stability.png": image})


def _paint(figure: Figure, results: Sequence[CaseResult]) -> None:
    axes = figure.subplots()
    for outcome, style in zip(CaseOutcome, ("go", "yD", "rX"), strict=True):
        rows = [n for n, result in enumerate(results) if result.outcome is outcome]
        errors = [results[n].first.error_um or 0.0 for n in rows]
        axes.plot(errors, rows, style, markersize=4, label=outcome.value)
    axes.plot([result.first.bound_um for result in results], range(len(results)), "k|")
    axes.set_yticks(range(len(results)), [result.case.name for result in results], fontsize=6)
    axes.set_ylim(len(results), -1)
    axes.set_xscale("log")
    axes.grid(axis="x", color="0.9")
    axes.set_xlabel("error of the depth, RMS (um); bar: largest error that passes")
    axes.legend()
