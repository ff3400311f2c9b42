"""The report as one self-contained HTML file: no scripts, no links to other files, no fonts."""

from __future__ import annotations

import base64
from collections.abc import Iterable
from functools import cache

from jinja2 import Environment, PackageLoader, StrictUndefined, Template

from gelpolight_core.quality import Verdict, verdict_word
from gelpolight_core.report.document import MARKS, Report, Section, limit_text, value_text
from gelpolight_core.translation import current_language, tr


def report_html(report: Report) -> str:
    """Return the report as one self-contained HTML document; every text in it is escaped."""
    return _page().render(
        title=report.title,
        language=current_language(),
        report=report,
        intro="",
        sections=report.sections,
    )


def page_html(title: str, intro: str, sections: Iterable[Section]) -> str:
    """Return sections under a heading as one self-contained HTML document."""
    return _page().render(
        title=title,
        language=current_language(),
        report=None,
        intro=intro,
        sections=tuple(sections),
    )


@cache
def _page() -> Template:
    environment = Environment(
        loader=PackageLoader("gelpolight_core.report", "."),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["base64"] = lambda data: base64.b64encode(data).decode("ascii")
    environment.globals.update(
        tr=tr, value_text=value_text, limit_text=limit_text, verdict_text=_verdict_text
    )
    return environment.get_template("page.html.jinja")


def _verdict_text(verdict: Verdict) -> str:
    return f"{MARKS[verdict]} {verdict_word(verdict)}"
