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
from gelpolight_core.export.atomic import write_atomically
from gelpolight_core.quality import QualityTable, judge
from gelpolight_core.report.document import Drawing, Listing, Section
from gelpolight_core.translation import tr

COLUMNS = (
    "subject",
    "case",
    "what",
    "required",
    "verdict",
    "finite",
    "error_um",
    "bound_um",
    "flags",
    "condition",
    "rounds",
    "seconds",
    "memory_mb",
    "said",
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
                "flags": {} if seen is None else {k: round(v, 3) for k, v in seen.flags},
                "condition": _finite(None if seen is None else seen.condition),
                "rounds": None if seen is None else seen.rounds,
                "seconds": round(result.seconds, 3),
                "memory_mb": result.memory_mb,
                "said": result.said,
            }
        )
    return rows


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
        f"{result.said}"
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
    """Return how many cases ended how."""
    count = {o: sum(r.outcome is o for r in results) for o in Outcome}
    return tr("{p} right, {r} refused with the reason, {f} failed, of {n}").format(
        p=count[Outcome.PASSED], r=count[Outcome.REFUSED], f=count[Outcome.FAILED], n=len(results)
    )


def write_stability(
    results: Sequence[CaseResult], found: Sequence[Sensitivity], folder: Path
) -> list[Path]:
    """Write ``stability.html``, ``.csv``, ``.json`` and ``sensitivity.csv``; return the paths.

    Raises
    ------
    InputError
        If a file cannot be written.
    """
    rows, others = result_rows(results), sensitivity_rows(found)
    content = {"summary": summary_line(results), "cases": rows, "sensitivity": others}
    flat = [{**row, "flags": _flag_text(row["flags"])} for row in rows]
    texts = {
        "stability.csv": _csv_text(COLUMNS, flat),
        "stability.json": json.dumps(content, indent=1, allow_nan=False) + "\n",
    }
    if others:
        texts["sensitivity.csv"] = _csv_text(SENSITIVITY_COLUMNS, others)
    for name, text in texts.items():
        write_atomically(folder / name, lambda out, text=text: out.write(text.encode()))  # type: ignore[misc]
    page = folder / "stability.html"
    write_page(stability_page(results, found), page)
    return [page, *(folder / name for name in texts)]


def stability_page(results: Sequence[CaseResult], found: Sequence[Sensitivity]) -> Page:
    """Return the report as a page: a section for each subject, and the tornado chart."""
    subjects = list(dict.fromkeys(result.case.subject for result in results))
    sections = [_section(s, [r for r in results if r.case.subject == s]) for s in subjects]
    if found:
        drawing, listing = draw_tornado(found), _sensitivity_listing(found)
        said = tr("What one standard uncertainty of each calibration parameter does to the depth")
        sections.append(
            Section(
                "sensitivity", tr("Sensitivity"), said, QualityTable(), (), (drawing,), (listing,)
            )
        )
    return Page(tr("Stability"), summary_line(results), tuple(sections))


def _section(subject: str, results: Sequence[CaseResult]) -> Section:
    failed = sum(r.outcome is Outcome.FAILED for r in results)
    quality = QualityTable(
        (judge("failed", tr("Cases neither right nor refused"), float(failed), fail=0.0),)
    )
    drawings: tuple[Drawing, ...] = ()
    if any(r.seen is not None and r.seen.error_um is not None for r in results):
        drawings = (draw_outcomes(results),)
    listing = Listing(
        "",
        (
            tr("Case"),
            tr("Verdict"),
            tr("Error um"),
            tr("Condition"),
            tr("Rounds"),
            tr("s"),
            tr("What was seen"),
        ),
        tuple(_cells(result) for result in results),
        (3.0, 1.0, 1.0, 1.0, 0.8, 0.6, 4.0),
    )
    return Section(subject, subject.capitalize(), "", quality, (), drawings, (listing,))


def _cells(result: CaseResult) -> tuple[str, ...]:
    seen = result.seen
    flags = "" if seen is None else _flag_text(dict(seen.flags))
    said = (
        result.said
        if not flags
        else tr("{said}. Flagged: {flags}").format(said=result.said, flags=flags)
    )
    if result.memory_mb is not None:
        said = tr("{said}; {m:.0f} MB").format(said=said, m=result.memory_mb)
    return (
        tr("{what} - required: {required}").format(
            what=result.case.label, required=result.case.required
        ),
        result.outcome.value,
        "" if seen is None else _number(seen.error_um),
        "" if seen is None else _number(seen.condition),
        "" if seen is None or seen.rounds is None else str(seen.rounds),
        f"{result.seconds:.1f}",
        said,
    )


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
