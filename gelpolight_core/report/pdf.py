"""The report as A4 pages: text and tables are set line by line, drawings are placed."""

from __future__ import annotations

import io
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from matplotlib import rc_context
from matplotlib.backends.backend_pdf import FigureCanvasPdf, PdfPages
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.image import imread
from matplotlib.lines import Line2D
from matplotlib.textpath import text_to_path

from gelpolight_core.drawing_thread import in_drawing_thread
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
from gelpolight_core.report.typeface import printable
from gelpolight_core.translation import tr

PAGE_MM = (210.0, 297.0)
MARGIN_MM = 15.0
WIDTH_MM = PAGE_MM[0] - 2 * MARGIN_MM
BOTTOM_MM = PAGE_MM[1] - 17.0
POINT_MM = 25.4 / 72.0
LINE = 1.38
DARK, GREY, RULE = "#1b1f24", "#4a535e", "#dde2e7"
VERDICT_COLOURS = {Verdict.PASS: "#1b6e3a", Verdict.WARN: "#8a5200", Verdict.FAIL: "#b3211d"}
PLAIN, FIXED = "DejaVu Sans", "DejaVu Sans Mono"
_STYLE: dict[Any, Any] = {"text.parse_math": False, "pdf.fonttype": 42}


class _Pages:
    """Writes pages from top to bottom, and begins a new page when one is full."""

    def __init__(self, stream: io.BytesIO, title: str) -> None:
        information = {"Title": title, "Creator": "GelPoLight Studio", "CreationDate": None}
        self._pdf = PdfPages(stream, metadata=information)
        self._title = title
        self._number = 0
        self._begin()

    def _begin(self) -> None:
        self._figure = Figure(figsize=(PAGE_MM[0] / 25.4, PAGE_MM[1] / 25.4))
        FigureCanvasPdf(self._figure)
        self._number += 1
        self.y_mm = MARGIN_MM

    def turn(self) -> None:
        """Finish this page and begin another."""
        foot = PAGE_MM[1] - 9.0
        self.text(MARGIN_MM, foot, self._title, size=7.0, colour=GREY)
        self.text(PAGE_MM[0] - MARGIN_MM, foot, str(self._number), size=7.0, colour=GREY, end=True)
        self._pdf.savefig(self._figure)  # type: ignore[no-untyped-call]
        self._begin()

    def need(self, height_mm: float) -> None:
        """Begin a new page unless the given height is left on this one."""
        if self.y_mm + height_mm > BOTTOM_MM and self.y_mm > MARGIN_MM:
            self.turn()

    def close(self) -> None:
        """Finish the last page and the file."""
        self.turn()
        self._pdf.close()  # type: ignore[no-untyped-call]

    def text(
        self,
        x_mm: float,
        y_mm: float,
        text: str,
        *,
        size: float = 8.5,
        colour: str = DARK,
        bold: bool = False,
        end: bool = False,
        family: str = PLAIN,
    ) -> None:
        """Write one line with its top at `y_mm`; with `end`, it ends at `x_mm`."""
        self._figure.text(
            x_mm / PAGE_MM[0],
            1.0 - (y_mm + size * POINT_MM) / PAGE_MM[1],
            printable(text),
            fontsize=size,
            color=colour,
            fontweight="bold" if bold else "normal",
            fontfamily=family,
            ha="right" if end else "left",
            va="baseline",
        )

    def rule(self, y_mm: float, *, colour: str = RULE, points: float = 0.5) -> None:
        """Draw a line from margin to margin."""
        y = 1.0 - y_mm / PAGE_MM[1]
        left = MARGIN_MM / PAGE_MM[0]
        self._figure.add_artist(Line2D([left, 1.0 - left], [y, y], color=colour, linewidth=points))

    def image(self, drawing: Drawing) -> None:
        """Place a drawing and its caption."""
        lines = wrap(f"{drawing.caption}.", WIDTH_MM, 7.5)
        self.need(drawing.height_mm + len(lines) * 7.5 * POINT_MM * LINE + 3.0)
        axes = self._figure.add_axes(
            (
                MARGIN_MM / PAGE_MM[0],
                1.0 - (self.y_mm + drawing.height_mm) / PAGE_MM[1],
                drawing.width_mm / PAGE_MM[0],
                drawing.height_mm / PAGE_MM[1],
            )
        )
        axes.imshow(imread(io.BytesIO(drawing.png)), aspect="auto", interpolation="none")
        axes.set_axis_off()
        self.y_mm += drawing.height_mm + 1.0
        self.lines(lines, size=7.5, colour=GREY)
        self.y_mm += 3.0

    def lines(
        self, lines: Sequence[str], *, size: float = 8.5, colour: str = DARK, bold: bool = False
    ) -> None:
        """Write lines at the left margin, and move below them."""
        for line in lines:
            self.need(size * POINT_MM * LINE)
            self.text(MARGIN_MM, self.y_mm, line, size=size, colour=colour, bold=bold)
            self.y_mm += size * POINT_MM * LINE


def wrap(text: str, width_mm: float, size: float, *, family: str = PLAIN) -> list[str]:
    """Break text into lines of limited width; a word that is too long is broken too."""
    lines = [""]
    for word in printable(text).split(" "):
        longer = f"{lines[-1]} {word}".strip()
        if line_width_mm(longer, size, family) <= width_mm:
            lines[-1] = longer
            continue
        if lines[-1]:
            lines.append("")
        for character in word:
            if lines[-1] and line_width_mm(lines[-1] + character, size, family) > width_mm:
                lines.append("")
            lines[-1] += character
    return lines


def line_width_mm(text: str, size: float, family: str = PLAIN) -> float:
    """Return the width of a line."""
    font = FontProperties(family=family, size=size)
    width, _, _ = text_to_path.get_text_width_height_descent(text or " ", font, ismath=False)
    return float(width) * POINT_MM


@in_drawing_thread
def report_pdf(report: Report) -> bytes:
    """Return the report as a PDF file of A4 pages."""
    stream = io.BytesIO()
    with rc_context(_STYLE):
        pages = _Pages(stream, report.title)
        pages.lines(wrap(report.title, WIDTH_MM, 17.0), size=17.0, bold=True)
        pages.y_mm += 1.0
        pages.lines(
            [f"{MARKS[report.verdict]} {verdict_word(report.verdict)}"],
            size=11.0,
            colour=VERDICT_COLOURS[report.verdict],
            bold=True,
        )
        pages.y_mm += 1.5
        pages.lines(wrap(f"{report.validation.sentence}.", WIDTH_MM, 9.0), size=9.0)
        pages.y_mm += 2.0
        if report.validation.listing is not None:
            _listing(pages, report.validation.listing)
        _facts(pages, report.facts)
        _summary(pages, report.sections)
        for section in report.sections:
            _section(pages, section)
        pages.turn()
        _listing(pages, report.sources)
        pages.close()
    return stream.getvalue()


def _table(
    pages: _Pages,
    heads: Sequence[str],
    rows: Iterable[Sequence[str]],
    widths: Sequence[float],
    *,
    size: float = 7.5,
    colours: Sequence[Sequence[str]] = (),
    last_fixed: bool = False,
) -> None:
    """Write a table whose cells wrap; the headings are repeated on each page."""
    shares = np.asarray(widths, np.float64) / float(np.sum(widths))
    starts = MARGIN_MM + WIDTH_MM * np.concatenate([[0.0], np.cumsum(shares)[:-1]])
    step = size * POINT_MM * LINE

    def set_row(cells: Sequence[str], row_colours: Sequence[str], *, bold: bool) -> None:
        columns = []
        for k, cell in enumerate(cells):
            fixed = last_fixed and not bold and k == len(cells) - 1
            family = FIXED if fixed else PLAIN
            # Bold text is wider than the text that is measured.
            room = (WIDTH_MM * shares[k] - 2.0) * (0.9 if bold else 1.0)
            columns.append((wrap(cell, float(room), size, family=family), family))
        height = step * max(len(lines) for lines, _ in columns) + 1.4
        if pages.y_mm + height > BOTTOM_MM and not bold:
            pages.turn()
            set_row(heads, (), bold=True)
        for k, (lines, family) in enumerate(columns):
            colour = row_colours[k] if row_colours else DARK
            for i, line in enumerate(lines):
                pages.text(
                    float(starts[k]),
                    pages.y_mm + i * step,
                    line,
                    size=size,
                    colour=colour,
                    bold=bold,
                    family=family,
                )
        pages.y_mm += height
        pages.rule(pages.y_mm - 0.7, colour=DARK if bold else RULE, points=0.8 if bold else 0.4)

    pages.need(4 * step)
    if any(heads):
        set_row(heads, (), bold=True)
    for index, row in enumerate(rows):
        set_row(row, colours[index] if colours else (), bold=False)
    pages.y_mm += 2.5


def _facts(pages: _Pages, facts: Sequence[tuple[str, str]]) -> None:
    if facts:
        colours = [(GREY, DARK)] * len(facts)
        _table(pages, ("", ""), facts, (1.0, 2.4), size=8.0, colours=colours)


def _summary(pages: _Pages, sections: Sequence[Section]) -> None:
    pages.lines([tr("Summary")], size=10.0, bold=True)
    rows = [
        (section.title, _verdict(section.quality.verdict), "; ".join(section.quality.advice))
        for section in sections
    ]
    colours = [(DARK, VERDICT_COLOURS[s.quality.verdict], GREY) for s in sections]
    heads = (tr("Stage"), tr("Verdict"), tr("What to do"))
    _table(pages, heads, rows, (1.3, 0.8, 4.0), size=8.0, colours=colours)


def _verdict(verdict: Verdict) -> str:
    return f"{MARKS[verdict]} {verdict_word(verdict)}"


def _section(pages: _Pages, section: Section) -> None:
    first = section.drawings[0].height_mm if section.drawings else 0.0
    pages.y_mm += 3.0
    pages.need(min(40.0 + 4.0 * len(section.quality.figures) + first, 150.0))
    pages.rule(pages.y_mm, colour=DARK, points=1.2)
    pages.y_mm += 2.0
    verdict = section.quality.verdict
    pages.text(
        PAGE_MM[0] - MARGIN_MM,
        pages.y_mm + 1.0,
        _verdict(verdict),
        size=9.0,
        colour=VERDICT_COLOURS[verdict],
        bold=True,
        end=True,
    )
    pages.lines([section.title], size=12.0, bold=True)
    if section.intro:
        pages.lines(wrap(f"{section.intro}.", WIDTH_MM, 8.5), colour=GREY)
    pages.y_mm += 1.5
    _quality(pages, section.quality)
    _facts(pages, section.facts)
    for drawing in section.drawings:
        pages.image(drawing)
    for listing in section.listings:
        _listing(pages, listing)


def _quality(pages: _Pages, quality: QualityTable) -> None:
    rows, colours = [], []
    for figure in quality.figures:
        limit = limit_text(figure)
        passed = figure.verdict is Verdict.PASS
        advice = f" \N{EM DASH} {figure.advice}" if figure.advice and not passed else ""
        rows.append(
            (
                figure.label + advice,
                value_text(figure),
                limit,
                _verdict(figure.verdict) if limit else "",
            )
        )
        colours.append((DARK, DARK, DARK, VERDICT_COLOURS[figure.verdict]))
    if rows:
        heads = (tr("Figure"), tr("Value"), tr("Limit"), tr("Verdict"))
        _table(pages, heads, rows, (3.4, 1.0, 1.5, 0.9), colours=colours)


def _listing(pages: _Pages, listing: Listing) -> None:
    pages.need(16.0)
    if listing.title:
        pages.lines([listing.title], size=9.5, bold=True)
    size = 6.5 if listing.fixed_width else 7.0
    _table(
        pages,
        listing.heads,
        listing.rows,
        listing.widths,
        size=size,
        last_fixed=listing.fixed_width,
    )
