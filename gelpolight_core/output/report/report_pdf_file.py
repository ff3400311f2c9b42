"""The report file: A4 pages as PDF, set by typst, with the report's data attached as JSON."""

from __future__ import annotations

import json
import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, replace
from datetime import datetime
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from gelpolight_core.base.atomic_write import write_atomically
from gelpolight_core.base.errors import not_installed
from gelpolight_core.base.finding import Finding, Verdict
from gelpolight_core.base.version import __version__

from .document import Report, refuse_other_endings
from .drawing_tools import FONTS, printable

try:
    import typst
except ModuleNotFoundError as error:
    raise not_installed("typst", "Reports and figures", "report") from error

TEMPLATE = Path(__file__).with_name("report.typ")


def write_report(report: Report, path: Path) -> None:
    """Write a report as PDF, completely or not at all.

    Parameters
    ----------
    report : Report
        The report.
    path : Path
        Ending in ``.pdf``.

    Raises
    ------
    InputError
        If the name has another extension, or the file cannot be written.
    """
    refuse_other_endings(path)
    content = report_pdf(report)
    write_atomically(path, lambda stream: stream.write(content))


def report_pdf(report: Report) -> bytes:
    """Return the report as a PDF/A-3b file. Equal reports give equal files."""
    data = report_json(report)
    drawings = [drawing.svg for section in report.sections for drawing in section.drawings]
    pdf: bytes = typst.compile(
        TEMPLATE,
        font_paths=[FONTS],
        ignore_system_fonts=True,
        pdf_standards="a-3b",
        sys_inputs={
            "data": json.dumps(data, indent=1, allow_nan=False),
            # Such a file must not show a character that its fonts lack.
            "report": json.dumps(_plain(data, printable)),
            **{f"drawing-{number}": svg for number, svg in enumerate(drawings)},
        },
    )
    return pdf


def report_json(report: Report) -> Any:
    """Return the report as plain values: what the template shows and the file contains.

    Numbers that are not finite are None.
    """
    number = count()
    sections = [
        {
            "key": s.key,
            "title": s.title,
            "intro": s.intro,
            "verdict": s.quality.verdict,
            "advice": s.quality.remedies,
            "figures": [_figure(figure) for figure in s.quality.figures],
            "facts": s.facts,
            "drawings": [{"number": next(number), "caption": d.caption} for d in s.drawings],
            "listings": [asdict(listing) for listing in s.listings],
        }
        for s in report.sections
    ]
    return _plain(
        {
            "format": "gelpolight-report",
            "version": 1,
            "program": f"GelPoLight Studio {__version__}",
            **asdict(replace(report, sections=())),
            "date": _date(report.created),
            "sections": sections,
            "verdicts": {verdict: f"{verdict.sign} {verdict.word}" for verdict in Verdict},
        }
    )


def _figure(figure: Finding) -> dict[str, Any]:
    limit = figure.limit_text
    if figure.warn_limit is not None and figure.fail_limit is not None:
        sign = "<" if figure.higher_is_better else ">"
        limit += f" (fails {sign} {figure.fail_limit:.4g})"
    return {**figure.as_row(), "value_text": figure.value_text, "limit_text": limit}


def _date(created: str) -> tuple[int, ...] | None:
    """Return year to second of an ISO 8601 time, or None."""
    try:
        return tuple(datetime.fromisoformat(created).timetuple()[:6])
    except ValueError:
        return None


def _encodable(text: str) -> str:
    # Names of files may contain bytes that are not text.
    return text.encode("utf-8", "replace").decode("utf-8")


def _plain(value: Any, text: Callable[[str], str] = _encodable) -> Any:
    """Return nested values for JSON, with all texts changed by a function."""
    if isinstance(value, Mapping):
        return {_plain(key, text): _plain(part, text) for key, part in value.items()}
    if isinstance(value, tuple | list):
        return [_plain(part, text) for part in value]
    if isinstance(value, str):
        return text(value)
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value
