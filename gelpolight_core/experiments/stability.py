"""Extreme cases: each must be correct or be refused with its reason.

A case is a function that returns its measurement. An :class:`InputError` counts as refused, and so
does a wrong result that reports that it is not reliable. Any other exception is a failure of the
program; the run continues and the report shows it.
"""

from __future__ import annotations

import math
import time
import tracemalloc
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import StrEnum

from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr

Progress = Callable[[str, float], None]


class Outcome(StrEnum):
    """How a case ended."""

    PASSED = "passed"
    REFUSED = "refused"
    FAILED = "failed"


@dataclass(frozen=True, slots=True)
class ModeSeen:
    """Result of one mode in a case.

    Attributes
    ----------
    mode : str
        ``best``, ``balanced``, ``fast`` or ``paper``.
    error_um, bound_um : float or None
        As in :class:`Seen`; None where nothing was measured.
    warning : str
        What the result reports if it is not reliable; otherwise empty. summary : str
        What happened, in a few words.
    """

    mode: str
    error_um: float | None
    bound_um: float | None
    warning: str = ""
    summary: str = ""

    @property
    def outcome(self) -> Outcome:
        """How this mode ended."""
        if self.error_um is not None and self.error_um <= (
            math.inf if self.bound_um is None else self.bound_um
        ):
            return Outcome.PASSED
        return Outcome.REFUSED if self.warning else Outcome.FAILED


@dataclass(frozen=True, slots=True)
class Seen:
    """Measurement of a case.

    Attributes
    ----------
    right : bool
        Whether the case meets all its requirements.
    summary : str
        One sentence of what happened, without its full stop.
    finite : bool
        Whether every number of the result is finite.
    error_um, bound_um : float or None
        Root mean square error of the depth, and the largest accepted error; None without truth.
    flags : tuple of (name, percent)
        Share of the nodes with each flag, if there are any.
    condition : float or None
        Largest condition number of the light directions.
    rounds : int or None
        Near-light rounds, or those of the solver.
    warning : str
        What the result reports if it is not reliable; otherwise empty. modes : tuple of ModeSeen
        What each mode made of it, where several were run; the case ends as the worst of them.
    """

    right: bool
    summary: str
    finite: bool = True
    error_um: float | None = None
    bound_um: float | None = None
    flags: tuple[tuple[str, float], ...] = ()
    condition: float | None = None
    rounds: int | None = None
    warning: str = ""
    modes: tuple[ModeSeen, ...] = ()


@dataclass(frozen=True, slots=True)
class Case:
    """One extreme case.

    Attributes
    ----------
    name, subject : str
        On the command line, and the group that it belongs to.
    label : str
        What is done, as shown to the user.
    required : str
        The required result.
    run : callable
        Does it.
    quick : bool
        Whether it takes less than about a second.
    memory : bool
        Whether its memory is measured.
    """

    name: str
    subject: str
    label: str
    required: str
    run: Callable[[], Seen]
    quick: bool = True
    memory: bool = False


@dataclass(frozen=True, slots=True)
class CaseResult:
    """A case with its result.

    Attributes
    ----------
    case : Case
        What was done.
    outcome : Outcome
        How it ended.
    summary : str
        One sentence for the user, without its full stop.
    seen : Seen or None
        None where the case was refused or raised an error.
    seconds : float
        Of the whole case, its rendering included.
    memory_mb : float or None
        Peak memory of its arrays; None where it was not measured.
    """

    case: Case
    outcome: Outcome
    summary: str
    seen: Seen | None
    seconds: float
    memory_mb: float | None = None


def run_case(case: Case) -> CaseResult:
    """Run one case; any exception becomes its result, except Ctrl-C."""
    begin = time.perf_counter()
    if case.memory:
        tracemalloc.start()
    try:
        outcome, summary, seen = _outcome(case)
        seconds = time.perf_counter() - begin
        memory = tracemalloc.get_traced_memory()[1] / 1e6 if case.memory else None
    finally:
        if case.memory:
            tracemalloc.stop()
    return CaseResult(case, outcome, summary, seen, seconds, memory)


def _outcome(case: Case) -> tuple[Outcome, str, Seen | None]:
    try:
        seen = case.run()
    except InputError as error:
        return Outcome.REFUSED, str(error).rstrip("."), None
    except Exception as error:  # the report must show faults of the program
        return Outcome.FAILED, f"{type(error).__name__}: {error}", None
    if not seen.finite:
        text = tr("the result is not finite; {summary}")
        return Outcome.FAILED, text.format(summary=seen.summary), seen
    wrong = [mode for mode in seen.modes if mode.outcome is not Outcome.PASSED]
    if seen.right and not wrong and (seen.modes or _within_bound(seen)):
        return Outcome.PASSED, seen.summary, seen
    if seen.warning:
        return Outcome.REFUSED, f"{seen.summary}; {seen.warning}", seen
    failed = [mode.mode for mode in wrong if mode.outcome is Outcome.FAILED]
    if failed or not wrong or not seen.right:
        summary = seen.summary
        if failed:
            summary += "; " + tr("wrong without a note: {modes}").format(modes=", ".join(failed))
        return Outcome.FAILED, summary, seen
    warnings = "; ".join(dict.fromkeys(m.warning for m in wrong))
    return Outcome.REFUSED, f"{seen.summary}; {warnings}", seen


def _within_bound(seen: Seen) -> bool:
    if seen.error_um is None:
        return True
    # An error that is not a number exceeds every bound.
    return seen.error_um <= (math.inf if seen.bound_um is None else seen.bound_um)


def run_cases(
    cases: Sequence[Case],
    *,
    progress: Progress | None = None,
    done: Callable[[CaseResult], None] | None = None,
) -> tuple[CaseResult, ...]:
    """Run cases one after the other.

    Parameters
    ----------
    cases : sequence of Case
        From :func:`~gelpolight_core.experiments.stability_cases.all_cases`.
    progress : callable, optional
        Called with the present task and the share done, 0..1.
    done : callable, optional
        Called with each result.
    """
    results = []
    for number, case in enumerate(cases):
        if progress is not None:
            progress(case.name, number / len(cases))
        result = run_case(case)
        results.append(result)
        if done is not None:
            done(result)
    if progress is not None:
        progress("", 1.0)
    return tuple(results)


def chosen_cases(cases: Sequence[Case], names: str | None) -> tuple[Case, ...]:
    """Return the cases with the given names or subjects, separated by commas; all if none is given.

    Raises
    ------
    InputError
        If there is no such case.
    """
    if names is None:
        return tuple(cases)
    asked = [name.strip() for name in names.split(",")]
    known = {case.name for case in cases} | {case.subject for case in cases}
    for name in asked:
        if name not in known:
            raise InputError(
                tr("there is no case {name!r}").format(name=name),
                where="--only",
                advice=tr("Use some of {names}").format(names=", ".join(sorted(known))),
            )
    return tuple(case for case in cases if case.name in asked or case.subject in asked)
