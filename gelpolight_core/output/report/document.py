"""The report as plain values: its contents, without layout."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TypeVar

from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.finding import QualityTable, Verdict
from gelpolight_core.calibration.recipe import Facts

T = TypeVar("T")
ENDING = ".pdf"


@dataclass(frozen=True, slots=True)
class ReportDrawing:
    """One drawing of the report.

    Attributes
    ----------
    caption : str
        What the drawing shows and how to read it, without the last full stop.
    svg : str
        The drawing, of its size on paper.
    """

    caption: str
    svg: str


@dataclass(frozen=True, slots=True)
class TextTable:
    """A table of the report with texts as cells.

    Attributes
    ----------
    title : str
        Title above the table; may be empty.
    heads : tuple of str
        One for each column.
    rows : tuple of tuple of str
        Cells. A column of numbers is aligned to the right.
    """

    title: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]


def make_text_table(
    title: str, items: Iterable[T], *columns: tuple[str, Callable[[T], str]]
) -> TextTable:
    """Return a table with a row for each item.

    Parameters
    ----------
    title : str
        Above the table.
    items : iterable
        What is listed.
    columns : tuple of (str, callable)
        Each with its heading, and what returns its cell for an item.
    """
    heads, cells = zip(*columns, strict=True)
    return TextTable(title, heads, tuple(tuple(cell(item) for cell in cells) for item in items))


def number_text(value: float | None, form: str, unit: str = "") -> str:
    """Return a number as a cell, empty if it is not known."""
    return "" if value is None or not math.isfinite(value) else f"{value:{form}}{unit}"


def text_lines(table: TextTable) -> list[str]:
    """Return a table as lines of text with aligned columns, the title first."""
    cells = (table.heads, *table.rows)
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    rows = (map(str.ljust, row, widths) for row in cells)
    return [table.title, *("  ".join(row).rstrip() for row in rows)]


Parts = tuple[tuple[ReportDrawing, ...], tuple[TextTable, ...]]
"""Drawings and tables of a stage."""


@dataclass(frozen=True, slots=True)
class ReportSection:
    """One stage of the calibration.

    Attributes
    ----------
    key, title, intro : str
        Name for programs, heading, and a description of the stage without the last full stop.
    quality : QualityTable
        Its judged figures.
    facts : tuple of (label, value)
        Its results as numbers.
    drawings : tuple of ReportDrawing
        Its results as drawings.
    listings : tuple of TextTable
        Further tables.
    """

    key: str
    title: str
    intro: str
    quality: QualityTable
    facts: Facts = ()
    drawings: tuple[ReportDrawing, ...] = ()
    listings: tuple[TextTable, ...] = ()


@dataclass(frozen=True, slots=True)
class ValidationSummary:
    """What is known of the result on objects of known size.

    Attributes
    ----------
    sentence : str
        The result as a sentence without a full stop.
    verdict : Verdict
        A warning where nothing was measured.
    listing : TextTable or None
        Each object.
    data : mapping
        Its numbers for programs: plain values.
    """

    sentence: str
    verdict: Verdict
    listing: TextTable | None = None
    data: Mapping[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, slots=True)
class Report:
    """A whole report: verdict, sections, validation and tables.

    Attributes
    ----------
    title : str
        Heading.
    verdict : Verdict or None
        Verdict on all of it. None: there was nothing to decide.
    sections : tuple of ReportSection
        In their order.
    cause : str
        The most likely cause of what is not within its limits, as a sentence without a full stop.
    facts : tuple of (label, value)
        Sensor and provenance.
    validation : ValidationSummary or None
        Results on objects of known size.
    listings : tuple of TextTable
        Long tables at the end.
    created : str
        ISO 8601 time of what is reported; empty if unknown.
    data : mapping
        Further numbers for programs: plain values.
    """

    title: str
    verdict: Verdict | None
    sections: tuple[ReportSection, ...]
    cause: str = ""
    facts: Facts = ()
    validation: ValidationSummary | None = None
    listings: tuple[TextTable, ...] = ()
    created: str = ""
    data: Mapping[str, Any] = field(default_factory=dict)


def refuse_other_endings(path: Path) -> None:
    """Refuse a report name that does not end in .pdf.

    Raises
    ------
    InputError
        If it does not.
    """
    if path.suffix.lower() != ENDING:
        raise InputError(
            "A report is written as PDF, so its name must end in .pdf", path, Remedy.CHOOSE_NAME
        )
