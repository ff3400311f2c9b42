"""A page of an experiment: sections with figures and tables, like the calibration report."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from gelpolight_core.io.atomic import write_atomically
from gelpolight_core.report.document import Section
from gelpolight_core.report.html import page_html


@dataclass(frozen=True, slots=True)
class Page:
    """Results of an experiment for people.

    Attributes
    ----------
    title, intro : str
        Heading, and a sentence or two below it, without the last full stop.
    sections : tuple of Section
        In their order.
    """

    title: str
    intro: str
    sections: tuple[Section, ...]


def write_page(page: Page, path: Path) -> None:
    """Write a page as one self-contained HTML file, completely or not at all.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    text = page_html(page.title, page.intro, page.sections)
    write_atomically(path, lambda out: out.write(text.encode()))
