"""The report as one HTML file that needs nothing else: no script, no address, no font."""

from __future__ import annotations

import base64
from collections.abc import Iterable
from html import escape

from gelpolight_core.quality import QualityTable, Verdict, verdict_word
from gelpolight_core.report.document import (
    MARKS,
    Drawing,
    Listing,
    Report,
    Section,
    limit_text,
    value_text,
)
from gelpolight_core.translation import tr

_STYLE = """
:root { color-scheme: light; }
* { box-sizing: border-box; }
body { margin: 0 auto; max-width: 210mm; padding: 12mm 15mm; color: #1b1f24; background: #fff;
  font: 10pt/1.45 "Segoe UI", "Noto Sans", "DejaVu Sans", Arial, sans-serif; }
h1 { font-size: 20pt; margin: 0 0 2mm; line-height: 1.15; }
h2 { font-size: 13pt; margin: 9mm 0 1mm; padding-top: 3mm; border-top: 1.5pt solid #1b1f24;
  break-after: avoid; display: flex; justify-content: space-between; align-items: baseline; }
h3 { font-size: 10pt; margin: 4mm 0 1mm; break-after: avoid; }
p { margin: 0 0 3mm; }
.intro, figcaption { color: #4a535e; }
.badge { font-size: 10pt; font-weight: 600; padding: 0.3mm 2.5mm; border-radius: 3mm;
  border: 1pt solid currentColor; white-space: nowrap; }
.pass { color: #1b6e3a; } .warn { color: #8a5200; } .fail { color: #b3211d; }
.box { border: 1pt solid #c5ccd4; border-left-width: 4pt; border-radius: 1mm; padding: 2mm 3mm;
  margin: 3mm 0; break-inside: avoid; }
table { border-collapse: collapse; width: 100%; font-size: 8.5pt; margin: 1mm 0 3mm; }
th { text-align: left; font-weight: 600; border-bottom: 1pt solid #1b1f24; }
th, td { padding: 0.8mm 2mm 0.8mm 0; vertical-align: top; overflow-wrap: break-word; }
td { border-bottom: 0.5pt solid #dde2e7; }
tr { break-inside: avoid; }
thead { display: table-header-group; }
.facts th { width: 34%; font-weight: 400; color: #4a535e; border-bottom: 0.5pt solid #dde2e7; }
.number { white-space: nowrap; font-variant-numeric: tabular-nums; }
.advice { color: #8a5200; }
.fixed td { overflow-wrap: anywhere; }
.fixed td:last-child { font: 7.2pt "DejaVu Sans Mono", Consolas, monospace; }
figure { margin: 3mm 0; break-inside: avoid; }
figure img { width: 100%; height: auto; display: block; }
figcaption { font-size: 8.5pt; margin-top: 1mm; }
a { color: #1f4fbf; text-decoration: none; }
@page { size: A4; margin: 14mm 15mm; }
@media print { body { padding: 0; max-width: none; } }
"""


def report_html(report: Report) -> str:
    """Return the report as one self-contained HTML document; every text in it is escaped."""
    return _document(
        report.title,
        [
            f"<p>{_badge(report.verdict)}</p>",
            _validation(report),
            _facts(report.facts),
            _summary(report.sections),
            *(_section(section) for section in report.sections),
            f'<h2 id="sources">{escape(report.sources.title)}</h2>',
            _listing(report.sources, headed=False),
        ],
    )


def page_html(title: str, intro: str, sections: Iterable[Section]) -> str:
    """Return sections under a heading as one self-contained HTML document."""
    lead = f'<p class="intro">{escape(intro)}.</p>' if intro else ""
    return _document(title, [lead, *(_section(section) for section in sections)])


def _document(title: str, parts: Iterable[str]) -> str:
    return "\n".join(
        [
            "<!DOCTYPE html>",
            '<html lang="en">',
            '<head><meta charset="utf-8">',
            '<meta name="viewport" content="width=device-width, initial-scale=1">',
            f"<title>{escape(title)}</title>",
            f"<style>{_STYLE}</style></head>",
            "<body>",
            f"<h1>{escape(title)}</h1>",
            *parts,
            "</body></html>\n",
        ]
    )


def _badge(verdict: Verdict) -> str:
    word = escape(f"{MARKS[verdict]} {verdict_word(verdict)}")
    return f'<span class="badge {verdict.value}">{word}</span>'


def _validation(report: Report) -> str:
    box = f'<p class="box">{escape(report.validation.sentence)}.</p>'
    if report.validation.listing is None:
        return box
    return box + _listing(report.validation.listing)


def _facts(facts: Iterable[tuple[str, str]]) -> str:
    rows = "".join(f"<tr><th>{escape(k)}</th><td>{escape(v)}</td></tr>" for k, v in facts)
    return f'<table class="facts"><tbody>{rows}</tbody></table>' if rows else ""


def _summary(sections: Iterable[Section]) -> str:
    """Return one line per stage, with what to do where it did not pass."""
    rows = []
    for section in sections:
        advice = escape("; ".join(section.quality.advice))
        rows.append(
            f'<tr><td><a href="#{escape(section.key)}">{escape(section.title)}</a></td>'
            f"<td>{_verdict(section.quality.verdict)}</td>"
            f'<td class="advice">{advice}</td></tr>'
        )
    head = "".join(f"<th>{escape(h)}</th>" for h in (tr("Stage"), tr("Verdict"), tr("What to do")))
    return (
        f"<h3>{escape(tr('Summary'))}</h3>"
        f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>"
    )


def _verdict(verdict: Verdict) -> str:
    word = escape(f"{MARKS[verdict]} {verdict_word(verdict)}")
    return f'<span class="number {verdict.value}">{word}</span>'


def _section(section: Section) -> str:
    intro = f'<p class="intro">{escape(section.intro)}.</p>' if section.intro else ""
    return "\n".join(
        [
            f'<h2 id="{escape(section.key)}"><span>{escape(section.title)}</span>'
            f"{_badge(section.quality.verdict) if section.quality.figures else ''}</h2>",
            intro,
            _quality(section.quality),
            _facts(section.facts),
            *(_figure(drawing) for drawing in section.drawings),
            *(_listing(listing) for listing in section.listings),
        ]
    )


def _quality(quality: QualityTable) -> str:
    if not quality.figures:
        return ""
    rows = []
    for figure in quality.figures:
        advice = ""
        if figure.verdict is not Verdict.PASS and figure.advice:
            advice = f'<div class="advice">{escape(figure.advice)}.</div>'
        rows.append(
            f"<tr><td>{escape(figure.label)}{advice}</td>"
            f'<td class="number">{escape(value_text(figure))}</td>'
            f'<td class="number">{escape(limit_text(figure))}</td>'
            f"<td>{_verdict(figure.verdict) if limit_text(figure) else ''}</td></tr>"
        )
    heads = (tr("Figure"), tr("Value"), tr("Limit"), tr("Verdict"))
    head = "".join(f"<th>{escape(h)}</th>" for h in heads)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{''.join(rows)}</tbody></table>"


def _figure(drawing: Drawing) -> str:
    data = base64.b64encode(drawing.png).decode("ascii")
    caption = escape(drawing.caption)
    return (
        f'<figure><img alt="{caption}" src="data:image/png;base64,{data}">'
        f"<figcaption>{caption}.</figcaption></figure>"
    )


def _listing(listing: Listing, *, headed: bool = True) -> str:
    title = f"<h3>{escape(listing.title)}</h3>" if headed and listing.title else ""
    head = "".join(f"<th>{escape(h)}</th>" for h in listing.heads)
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(cell)}</td>" for cell in row) + "</tr>"
        for row in listing.rows
    )
    kind = ' class="fixed"' if listing.fixed_width else ""
    return f"{title}<table{kind}><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
