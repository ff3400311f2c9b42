"""The stability report as text, HTML, CSV and JSON."""

from __future__ import annotations

import csv
import io
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from gelpolight_core.experiments.report_page import Page, write_page
from gelpolight_core.experiments.sensitivity import Sensitivity
from gelpolight_core.experiments.stability import CaseResult, Outcome
from gelpolight_core.experiments.stability_figures import draw_outcomes, draw_tornado
from gelpolight_core.experiments.stability_sessions import LengthCost
from gelpolight_core.io.atomic import write_atomically
from gelpolight_core.quality import QualityTable, judge
from gelpolight_core.report.document import Drawing, Listing, Section
from gelpolight_core.translation import tr

MODE_NAMES = ("best", "balanced", "fast", "paper")
COLUMNS = (
    "subject",
    "case",
    "what",
    "required",
    "verdict",
    "finite",
    "error_um",
    "bound_um",
    *(f"{mode}_um" for mode in MODE_NAMES),
    "flags",
    "condition",
    "rounds",
    "seconds",
    "memory_mb",
    "message",
)
LENGTH_COLUMNS = (
    "length",
    "height_percent_per_percent",
    "size_percent_per_percent",
    "verdict",
)
SENSITIVITY_COLUMNS = (
    "parameter",
    "unit",
    "standard_uncertainty",
    "source",
    "height_low_percent",
    "height_high_percent",
    "rms_um",
    "height_percent_per_unit",
)


def result_rows(results: Sequence[CaseResult]) -> list[dict[str, Any]]:
    """Return one row for each case, by the names of :data:`COLUMNS`; None where unknown."""
    rows = []
    for result in results:
        case, seen = result.case, result.seen
        rows.append(
            {
                "subject": case.subject,
                "case": case.name,
                "what": case.label,
                "required": case.required,
                "verdict": result.outcome.value,
                "finite": None if seen is None else seen.finite,
                "error_um": _finite(None if seen is None else seen.error_um),
                "bound_um": _finite(None if seen is None else seen.bound_um),
                **_mode_errors(result),
                "flags": {} if seen is None else {k: round(v, 3) for k, v in seen.flags},
                "condition": _finite(None if seen is None else seen.condition),
                "rounds": None if seen is None else seen.rounds,
                "seconds": round(result.seconds, 3),
                "memory_mb": result.memory_mb,
                "message": result.summary,
            }
        )
    return rows


def _mode_errors(result: CaseResult) -> dict[str, float | None]:
    modes = {} if result.seen is None else {mode.mode: mode for mode in result.seen.modes}
    return {
        f"{name}_um": _finite(modes[name].error_um) if name in modes else None
        for name in MODE_NAMES
    }


def length_rows(costs: Sequence[LengthCost]) -> list[dict[str, Any]]:
    """Return one row for each stated length, by the names of :data:`LENGTH_COLUMNS`."""
    return [
        {
            "length": cost.length.key,
            "height_percent_per_percent": _finite(cost.height_percent),
            "size_percent_per_percent": _finite(cost.size_percent),
            "verdict": cost.verdict,
        }
        for cost in costs
    ]


def length_table(costs: Sequence[LengthCost]) -> str:
    """Return the effect of 1 % of each stated length as lines of text."""
    head = f"{tr('1 % wrong'):<38}{tr('height %'):>10}{tr('size %'):>10}  {tr('calibration')}"
    lines = [
        f"{cost.length.label:<38}{cost.height_percent:+10.2f}{cost.size_percent:+10.2f}"
        f"  {cost.verdict}"
        for cost in costs
    ]
    return "\n".join([head, *lines])


def sensitivity_rows(found: Sequence[Sensitivity]) -> list[dict[str, Any]]:
    """Return one row for each parameter, by the names of :data:`SENSITIVITY_COLUMNS`."""
    return [
        {
            "parameter": s.parameter.name,
            "unit": s.parameter.unit,
            "standard_uncertainty": s.parameter.sd,
            "source": s.parameter.source,
            "height_low_percent": s.low_percent,
            "height_high_percent": s.high_percent,
            "rms_um": s.rms_um,
            "height_percent_per_unit": s.unit_percent,
        }
        for s in found
    ]


def result_line(result: CaseResult) -> str:
    """Return one case as a line of text."""
    seen = result.seen
    error = "" if seen is None or seen.error_um is None else f"{seen.error_um:.3g}"
    return (
        f"{result.outcome.value:<8} {result.case.name:<32}{error:>9} um{result.seconds:7.1f} s  "
        f"{result.summary}"
    )


def sensitivity_table(found: Sequence[Sensitivity]) -> str:
    """Return the parameters as lines of text, largest first."""
    head = (
        f"{tr('parameter'):<38}{tr('uncertainty'):>14}{tr('low %'):>9}{tr('high %'):>9}"
        f"{tr('RMS um'):>9}{tr('% per unit'):>12}"
    )
    lines = [
        f"{s.parameter.label:<38}{s.parameter.stated:>14}"
        f"{s.low_percent:+9.2f}{s.high_percent:+9.2f}{s.rms_um:9.1f}{s.unit_percent:+12.2f}"
        for s in found
    ]
    return "\n".join([head, *lines])


def summary_line(results: Sequence[CaseResult]) -> str:
    """Return the number of cases with each outcome."""
    count = {o: sum(r.outcome is o for r in results) for o in Outcome}
    return tr("{p} passed, {r} refused with the reason, {f} failed, of {n}").format(
        p=count[Outcome.PASSED], r=count[Outcome.REFUSED], f=count[Outcome.FAILED], n=len(results)
    )


def write_stability(
    results: Sequence[CaseResult],
    found: Sequence[Sensitivity],
    costs: Sequence[LengthCost],
    folder: Path,
) -> list[Path]:
    """Write ``stability.html``, ``.csv``, ``.json``, ``sensitivity.csv`` and ``lengths.csv``.

    Parameters
    ----------
    results : sequence of CaseResult
        Of the cases.
    found : sequence of Sensitivity
        Of the calibration parameters; empty where not requested.
    costs : sequence of LengthCost
        Of the stated lengths; empty where not requested.
    folder : Path
        Where to write.

    Returns
    -------
    list of Path

    Raises
    ------
    InputError
        If a file cannot be written.
    """
    rows, others = result_rows(results), sensitivity_rows(found)
    lengths = length_rows(costs)
    content = {
        "summary": summary_line(results),
        "cases": rows,
        "sensitivity": others,
        "lengths": lengths,
    }
    flat = [{**row, "flags": _flag_text(row["flags"])} for row in rows]
    texts = {
        "stability.csv": _csv_text(COLUMNS, flat),
        "stability.json": json.dumps(content, indent=1, allow_nan=False) + "\n",
    }
    if others:
        texts["sensitivity.csv"] = _csv_text(SENSITIVITY_COLUMNS, others)
    if lengths:
        texts["lengths.csv"] = _csv_text(LENGTH_COLUMNS, lengths)
    for name, text in texts.items():
        write_atomically(folder / name, lambda out, text=text: out.write(text.encode()))  # type: ignore[misc]
    page = folder / "stability.html"
    write_page(stability_page(results, found, costs), page)
    return [page, *(folder / name for name in texts)]


def stability_page(
    results: Sequence[CaseResult], found: Sequence[Sensitivity], costs: Sequence[LengthCost] = ()
) -> Page:
    """Return the report as a page: a section for each subject, tornado chart, stated lengths."""
    subjects = list(dict.fromkeys(result.case.subject for result in results))
    sections = [_section(s, [r for r in results if r.case.subject == s]) for s in subjects]
    if found:
        drawing, listing = draw_tornado(found), _sensitivity_listing(found)
        text = tr("Effect of one standard uncertainty of each calibration parameter on the depth")
        sections.append(
            Section(
                "sensitivity", tr("Sensitivity"), text, QualityTable(), (), (drawing,), (listing,)
            )
        )
    if costs:
        text = tr("Effect of 1 % in each length of session.toml on a measured cylinder")
        listing = _length_listing(costs)
        sections.append(
            Section("lengths", tr("Stated lengths"), text, QualityTable(), (), (), (listing,))
        )
    return Page(tr("Stability"), summary_line(results), tuple(sections))


def _length_listing(costs: Sequence[LengthCost]) -> Listing:
    heads = (tr("1 % wrong"), tr("Height, %"), tr("Size, %"), tr("Calibration's verdict"))
    rows = tuple(
        (c.length.label, f"{c.height_percent:+.2f}", f"{c.size_percent:+.2f}", c.verdict)
        for c in costs
    )
    return Listing("", heads, rows, (3.0, 1.0, 1.0, 1.0))


def _section(subject: str, results: Sequence[CaseResult]) -> Section:
    failed = sum(r.outcome is Outcome.FAILED for r in results)
    quality = QualityTable(
        (judge("failed", tr("Cases neither passed nor refused"), float(failed), fail=0.0),)
    )
    drawings: tuple[Drawing, ...] = ()
    if any(r.seen is not None and r.seen.error_um is not None for r in results):
        drawings = (draw_outcomes(results),)
    listing = Listing(
        "",
        (
            tr("Case"),
            tr("Verdict"),
            tr("Error um: best, balanced, fast, paper"),
            tr("Condition"),
            tr("Rounds"),
            tr("s"),
            tr("Result"),
        ),
        tuple(_cells(result) for result in results),
        (3.0, 1.0, 1.6, 1.0, 0.8, 0.6, 4.0),
    )
    return Section(subject, subject.capitalize(), "", quality, (), drawings, (listing,))


def _cells(result: CaseResult) -> tuple[str, ...]:
    seen = result.seen
    flags = "" if seen is None else _flag_text(dict(seen.flags))
    summary = (
        result.summary
        if not flags
        else tr("{summary}. Flagged: {flags}").format(summary=result.summary, flags=flags)
    )
    if result.memory_mb is not None:
        summary = tr("{summary}; {m:.0f} MB").format(summary=summary, m=result.memory_mb)
    return (
        tr("{what} - required: {required}").format(
            what=result.case.label, required=result.case.required
        ),
        result.outcome.value,
        _error_text(result),
        "" if seen is None else _number(seen.condition),
        "" if seen is None or seen.rounds is None else str(seen.rounds),
        f"{result.seconds:.1f}",
        summary,
    )


def _error_text(result: CaseResult) -> str:
    """Return the error, or that of each mode where several were run."""
    seen = result.seen
    if seen is None:
        return ""
    if not seen.modes:
        return _number(seen.error_um)
    errors = _mode_errors(result)
    return ", ".join(_number(errors[f"{name}_um"]) or "-" for name in MODE_NAMES)


def _sensitivity_listing(found: Sequence[Sensitivity]) -> Listing:
    heads = (
        tr("Parameter"),
        tr("Uncertainty"),
        tr("From"),
        tr("Height, low %"),
        tr("Height, high %"),
        tr("Depth, RMS um"),
        tr("Height, % per unit"),
    )
    rows = tuple(
        (
            s.parameter.label,
            s.parameter.stated,
            s.parameter.source,
            f"{s.low_percent:+.2f}",
            f"{s.high_percent:+.2f}",
            f"{s.rms_um:.1f}",
            f"{s.unit_percent:+.2f}",
        )
        for s in found
    )
    return Listing("", heads, rows, (3.0, 1.0, 2.0, 1.0, 1.0, 1.0, 1.0))


def _csv_text(columns: Sequence[str], rows: Sequence[dict[str, Any]]) -> str:
    stream = io.StringIO()
    writer = csv.DictWriter(stream, columns, lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return stream.getvalue()


def _flag_text(flags: dict[str, float]) -> str:
    return ", ".join(f"{name} {share:.2g} %" for name, share in flags.items())


def _finite(value: float | None) -> float | None:
    return None if value is None or not math.isfinite(value) else value


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.3g}"
