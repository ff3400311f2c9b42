"""The chapter on quality figures names every figure that the program judges, and its limits."""

import ast
import re
from collections.abc import Iterator
from functools import cache

import pytest
from chapter import DOCS

from gelpolight_core.base.compared_quantity import TOLERANCE_PERCENT
from gelpolight_core.base.finding import Finding
from gelpolight_core.measurement.statistics import NEEDED_FREEDOM, SD_ERROR
from gelpolight_core.reconstruction.height_map import FLAG_NAMES

ROOT = DOCS.parent
NOTHING = "\N{EN DASH}"
JUDGES = ("judge", "guarded", "judge_excluded_images")
CHAPTER = (DOCS / "reference/quality-figures.md").read_text("utf-8")


def keys_of(source: str) -> Iterator[str]:
    """Return the keys of the figures that a module judges, with * for what is filled in."""
    for call in ast.walk(ast.parse(source)):
        if isinstance(call, ast.Call) and isinstance(call.func, ast.Name):
            declared = {argument.arg for argument in call.keywords if call.func.id == "Parameter"}
            key = call.args[0] if call.func.id in JUDGES or "figure" in declared else None
            if isinstance(key, ast.Constant):
                yield str(key.value)
            elif isinstance(key, ast.JoinedStr):
                yield re.sub(r"\{[^}]*\}", "*", ast.unparse(key)[2:-1])
    if "indentation" in source:
        yield from re.findall(r'\bfigure\(\s*"(\w+)"', source)


@cache
def judged() -> frozenset[str]:
    """Return the keys of all figures of core and program."""
    files = [p for name in ("gelpolight_core", "app") for p in (ROOT / name).rglob("*.py")]
    texts = (path.read_text("utf-8") for path in files if path.name != "finding.py")
    return frozenset(key for text in texts for key in keys_of(text))


@cache
def rows() -> dict[str, list[tuple[str, str]]]:
    """Return the limits (for a warning, for a failure) of the chapter's rows by key."""
    found: dict[str, list[tuple[str, str]]] = {}
    for section in re.split(r"^## ", CHAPTER, flags=re.MULTILINE)[1:]:
        table = section.partition("\n| figure |")[2].partition("\n\n")[0]
        for line in table.splitlines()[2:]:
            _, figure, limits, *_ = (cell.strip() for cell in line.split("|"))
            if (key := re.search(r"`([\w*]+)`", figure)) is not None:
                warn, _, fail = limits.rpartition(" / ")
                found.setdefault(key[1], []).append((warn or limits, fail or limits))
    return found


def test_the_chapter_and_the_program_have_the_same_figures():
    assert len(judged()) > 80
    assert set(rows()) == judged()


def test_every_limit_of_a_calibration_is_the_chapters(small_calibration):
    figures = [f for table in small_calibration.quality.values() for f in table.figures]
    assert len(figures) > 40
    for figure in figures:
        assert any(stated(figure, *row) for row in rows()[figure.key]), figure


def stated(figure: Finding, warn: str, fail: str) -> bool:
    """Return whether a row has the limits of a figure; limits in words are not compared."""
    for cell, limit in ((warn, figure.warn_limit), (fail, figure.fail_limit)):
        number = re.fullmatch(r"[<>] (\d+(?:\.(\d+))?)(?: (\S+))?", cell)
        if number is None:
            if (limit is None) != (cell == NOTHING):
                return False
        elif limit is None or (number[3] or "") != figure.unit:
            return False
        elif float(number[1]) != round(limit, len(number[2] or "")):
            return False
    return True


def test_the_limits_of_a_validation_are_those_of_a_new_installation():
    """The chapter says when a calibration counts as validated, and when as old."""
    # By its text: the module needs a window library, which this folder does without.
    source = (ROOT / "app/program/preferences.py").read_text("utf-8")
    age_days = re.search(r"^    age_days: float = number\(([\d.]+)", source, re.M)
    assert age_days is not None
    text = " ".join(CHAPTER.split())
    size_percent, height_percent = TOLERANCE_PERCENT
    assert f"height is right to {height_percent:g} % and its size to {size_percent:g} %" in text
    assert f"older than {float(age_days[1]):g} days" in text
    assert f"Below f = {NEEDED_FREEDOM} ({100.0 * SD_ERROR:g} %" in text


@pytest.mark.parametrize("flag", FLAG_NAMES)
def test_every_flag_is_explained(flag):
    assert f"| `{flag}` |" in CHAPTER
