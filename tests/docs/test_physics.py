"""The chapters name modules that are there, and repeat figures as they were measured."""

from __future__ import annotations

import re

import pytest
from chapter import DOCS

CHAPTERS = ("reference/library.md", "reference/physics.md", "reference/quality-figures.md")
COLUMNS = (
    "Sensor A: matt",
    "Sensor B: glossy",
    "Sensor C: very",
    "The virtual sensor as it",
    "The virtual sensor of `resources/designs/hard.toml`",
)


@pytest.mark.parametrize("name", CHAPTERS)
def test_every_module_that_a_chapter_names_is_there(name: str) -> None:
    """A module that is renamed is renamed in the documentation."""
    text = (DOCS / name).read_text("utf-8")
    for path in re.findall(r"`((?:gelpolight_core|app)/[\w./]*)`", text):
        assert (DOCS.parent / path).exists(), path


@pytest.mark.parametrize("name", CHAPTERS)
def test_every_reference_leads_to_a_heading(name: str) -> None:
    """Chapters refer to each other's sections, and need no network."""
    for link in re.findall(r"\]\(([^)]+)\)", (DOCS / name).read_text("utf-8")):
        file, _, anchor = link.partition("#")
        target = (DOCS / (file or name)).read_text("utf-8")
        headings = re.findall(r"^#+ (.+)$", target, flags=re.MULTILINE)
        slugs = {re.sub(r"[^\w\- ]", "", h.lower()).replace(" ", "-") for h in headings}
        assert not anchor or anchor in slugs, link


@pytest.mark.parametrize("name", CHAPTERS)
def test_formulas_can_be_read_without_anything_that_is_loaded(name: str) -> None:
    """No TeX: the pages are read on machines without a network."""
    text = (DOCS / name).read_text("utf-8")
    assert "$" not in re.sub(r"```.*?```", "", text, flags=re.DOTALL)
    assert r"\frac" not in text


def worths() -> list[dict[str, float]]:
    """Return what each term is worth on each sensor, um, as the tables of the ablation say."""
    text = (DOCS / "studies/ablation.md").read_text("utf-8")
    found = []
    for column in COLUMNS:
        table = text[text.index(f"### {column}") :].partition("\n### ")[0]
        rows = [line.split("|") for line in table.splitlines() if line.startswith("| ")]
        worth = {cells[1].strip(): float(cells[7]) for cells in rows if "um" not in cells[5]}
        worth["all"] = next(float(cells[5]) for cells in rows if cells[1].strip() == "all")
        found.append(worth)
    return found


def test_the_terms_are_worth_what_the_ablation_found() -> None:
    """The chapter's table is that of the ablation, which is made by a command."""
    text = (DOCS / "reference/physics.md").read_text("utf-8")
    section = text[text.index("## What each term is worth") :].partition("\n## ")[0]
    rows = [line.split("|") for line in section.splitlines() if line.startswith("| ")]
    found = worths()
    compared = set()
    for cells in rows[1:]:
        name = re.search(r"\(`(\w+)`\)", cells[1])
        term = "all" if name is None else name[1]
        compared.add(term)
        for cell, worth in zip(cells[2 : 2 + len(COLUMNS)], found, strict=True):
            # A sensor whose calibration is refused without the term has no row for it.
            assert (cell.strip() == "refused") == (term not in worth), term
            assert term not in worth or float(cell) == pytest.approx(worth[term], abs=0.0501), term
    assert {"near_light_0", "interreflection", "gloss", "weights", "paper", "all"} <= compared
