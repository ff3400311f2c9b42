"""The report file: HTML or PDF depending on its extension, written completely or not at all."""

from __future__ import annotations

from pathlib import Path

from gelpolight_core.errors import InputError
from gelpolight_core.io.atomic import write_atomically
from gelpolight_core.report.document import Report
from gelpolight_core.report.html import report_html
from gelpolight_core.report.pdf import report_pdf
from gelpolight_core.translation import tr

ENDINGS = (".html", ".pdf")


def refuse_other_endings(path: Path) -> None:
    """Refuse a report name that ends in neither .html nor .pdf.

    Raises
    ------
    InputError
        If it does not.
    """
    if path.suffix.lower() not in ENDINGS:
        raise InputError(
            tr("A report can only be written as HTML or PDF"),
            where=str(path),
            advice=tr("Use a file name that ends in .html or .pdf"),
        )


def write_report(report: Report, path: Path) -> None:
    """Write a report as HTML or PDF.

    Parameters
    ----------
    report : Report
        The report.
    path : Path
        Ending in ``.html`` or ``.pdf``.

    Raises
    ------
    InputError
        If the name has another extension, or the file cannot be written.
    """
    refuse_other_endings(path)
    content = report_pdf(report) if path.suffix.lower() == ".pdf" else report_html(report).encode()
    write_atomically(path, lambda stream: stream.write(content))
