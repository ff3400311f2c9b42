"""The report as plain values: its contents, without layout."""

from __future__ import annotations

import math
from dataclasses import dataclass

from gelpolight_core.quality import Figure, QualityTable, Verdict
from gelpolight_core.translation import tr

ROUNDING = 1e-12
MARKS = {Verdict.PASS: "\N{CHECK MARK}", Verdict.WARN: "!", Verdict.FAIL: "\N{MULTIPLICATION X}"}
"""A symbol next to each verdict, so that it is not shown by colour alone."""


@dataclass(frozen=True, slots=True)
class Drawing:
    """One drawing of the report.

    Attributes
    ----------
    caption : str
        What the drawing shows and how to read it.
    png : bytes
        The image.
    width_mm, height_mm : float
        Size on paper.
    """

    caption: str
    png: bytes
    width_mm: float
    height_mm: float


@dataclass(frozen=True, slots=True)
class Listing:
    """A table: a title, column headings and rows of text.

    Attributes
    ----------
    title : str
        Title above the table; may be empty.
    heads : tuple of str
        One for each column.
    rows : tuple of tuple of str
        Cells.
    widths : tuple of float
        Relative widths of the columns on paper.
    fixed_width : bool
        Whether the last column uses a fixed-width font, as for hashes.
    """

    title: str
    heads: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    widths: tuple[float, ...]
    fixed_width: bool = False


@dataclass(frozen=True, slots=True)
class Parts:
    """Drawings and tables of one stage.

    Attributes
    ----------
    drawings : tuple of Drawing
        Its results as drawings.
    listings : tuple of Listing
        Tables beside its quality.
    """

    drawings: tuple[Drawing, ...] = ()
    listings: tuple[Listing, ...] = ()


@dataclass(frozen=True, slots=True)
class Section:
    """One stage of the calibration.

    Attributes
    ----------
    key, title, intro : str
        Name for links, heading, and a description of the stage.
    quality : QualityTable
        Its judged figures.
    facts : tuple of (label, value)
        Its results as numbers.
    drawings : tuple of Drawing
        Its results as drawings.
    listings : tuple of Listing
        Further tables.
    """

    key: str
    title: str
    intro: str
    quality: QualityTable
    facts: tuple[tuple[str, str], ...] = ()
    drawings: tuple[Drawing, ...] = ()
    listings: tuple[Listing, ...] = ()


@dataclass(frozen=True, slots=True)
class Validation:
    """Validation of the calibration on objects of known size.

    Attributes
    ----------
    sentence : str
        The result as a sentence without a full stop.
    listing : Listing or None
        Each object.
    """

    sentence: str
    listing: Listing | None = None


@dataclass(frozen=True, slots=True)
class Report:
    """A whole report.

    Attributes
    ----------
    title : str
        Heading.
    verdict : Verdict
        Verdict on the calibration.
    facts : tuple of (label, value)
        Sensor and provenance.
    validation : Validation
        Results on objects of known size.
    sections : tuple of Section
        The stages in order.
    sources : Listing
        Every source file, with its hash.
    """

    title: str
    verdict: Verdict
    facts: tuple[tuple[str, str], ...]
    validation: Validation
    sections: tuple[Section, ...]
    sources: Listing


def value_text(figure: Figure) -> str:
    """Return a figure's value with its unit."""
    # Show a rounded negative zero as zero.
    value = 0.0 if abs(figure.value) < ROUNDING else figure.value
    number = f"{value:.4g}" if math.isfinite(value) else tr("not a number")
    return f"{number} {figure.unit}".rstrip()


def limit_text(figure: Figure) -> str:
    """Return the limits of a figure; empty if it is only reported."""
    limits = [x for x in (figure.warn_limit, figure.fail_limit) if x is not None]
    if not limits:
        return ""
    at_most = not figure.higher_is_better
    sign = "\N{LESS-THAN OR EQUAL TO}" if at_most else "\N{GREATER-THAN OR EQUAL TO}"
    text = f"{sign} {limits[0]:.4g}"
    if figure.warn_limit is not None and figure.fail_limit is not None:
        text += tr(" (fails {sign} {limit:.4g})").format(
            sign=">" if at_most else "<", limit=figure.fail_limit
        )
    return text
