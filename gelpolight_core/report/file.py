"""The report's file: HTML or PDF by its name's ending, whole or not at all."""

from __future__ import annotations

from pathlib import Path

from gelpolight_core.errors import InputError
from gelpolight_core.export.atomic import write_atomically
from gelpolight_core.report.document import Report
from gelpolight_core.report.html import report_html
from gelpolight_core.report.pdf import report_pdf
from gelpolight_core.translation import tr

ENDINGS = (".html", ".pdf")


def refuse_other_endings(path: Path) -> None:
    """Refuse a report's name that ends neither in .html nor in .pdf.

    Raises
    ------
    InputError
        If it does not.
    """
    if path.suffix.lower() not in ENDINGS:
        raise InputError(
            tr("a report is written as HTML or PDF"),
            where=str(path),
            advice=tr("Let the file's name end in .html or .pdf"),
        )


def write_report(report: Report, path: Path) -> None:
    """Write a report as HTML or PDF.

    Parameters
    ----------
    report : Report
        What it says.
    path : Path
        Ending in ``.html`` or ``.pdf``.

    Raises
    ------
    InputError
        If the name ends otherwise, or the file cannot be written.
    """
    refuse_other_endings(path)
    content = report_pdf(report) if path.suffix.lower() == ".pdf" else report_html(report).encode()
    write_atomically(path, lambda stream: stream.write(content))
