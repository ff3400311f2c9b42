"""The chapter on quality figures names every figure that the program judges, and its limits."""

from __future__ import annotations

import ast
import importlib
import math
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from chapter import DOCS

from gelpolight_core.finding import Finding
from gelpolight_core.measurement.statistics import NEEDED_FREEDOM, SD_ERROR
from gelpolight_core.quantity import TOLERANCE_PERCENT
from gelpolight_core.reconstruction.height_map import FLAG_NAMES
from gelpolight_core.sensor_calibration import Calibration

ROOT = DOCS.parent
NOTHING = "\N{EN DASH}"
CHAPTER = (DOCS / "reference/quality-figures.md").read_text("utf-8")
HIGHER_IS_BETTER = {"axis_ratio", "signal_to_noise"}  # of a ball's contact
# What the chapter says of limits that depend on the image or the ball; its numbers are filled in
# from the module.
IN_WORDS = {
    "None if glossy else RADIUS_FAIL_PERCENT": "{RADIUS_FAIL_PERCENT:g} %",
    "100.0 * SIGMAS * sd": "{SIGMAS:g} standard deviations",
    "camera.width / 500.0": "width/500",
    "camera.width / 50.0": "width/50",
    "edge_limit_px(view.image_size[0])": "width / 200, at least 3 px",
    "LED_OFF_OF_WIDTH * rgb.shape[1]": "{LED_OFF_OF_WIDTH:g} widths",
    "LARGEST_SD * radius": "{100LARGEST_SD:g} % of the radius",
    "LEAST_INDEX if too_low else MOST_INDEX": "{MOST_INDEX:g} (or < {LEAST_INDEX:g})",
    "DOUBTFUL_SIGMAS * 100.0 * stretch.sd": "{DOUBTFUL_SIGMAS:g} standard deviations",
    "math.exp(DOUBTFUL_SDS * sd)": "{DOUBTFUL_SDS:g} standard deviations",
    "math.exp(IMPOSSIBLE_SDS * sd)": "{IMPOSSIBLE_SDS:g} standard deviations",
    "doubtful": "{SIZE_LIMITS[0]:g} %, and {DOUBTFUL_SDS:g} standard deviations",
    "impossible": "{SIZE_LIMITS[1]:g} %, and {DOUBTFUL_SDS:g} standard deviations",
    "0.9 * radius_mm": "0.9 ball radii",
    "0.15 * contact_mm": "0.15 contact radii",
    "0.4 * contact_mm": "0.4 contact radii",
    "200.0 * best.sd": "2 standard deviations",
    "limit - expanded": "tolerance \N{MINUS SIGN} U",
    "limit + expanded": "tolerance + U",
}
NOTES = {
    "UNSOLVED_SHARE": "gelpolight_core/reconstruction/checks.py",
    "HELD_DOWN_SHARE": "gelpolight_core/reconstruction/checks.py",
    "MOST_PITCH": "gelpolight_core/reconstruction/checks.py",
    "LEAST_HELD": "gelpolight_core/reconstruction/near_light/boundary.py",
    "LONGEST_STEP": "gelpolight_core/reconstruction/near_light/region_solver.py",
    "BETTER_SHAPE": "gelpolight_core/measurement/fit_checks.py",
    "GOOD_RESIDUAL": "gelpolight_core/measurement/fit_checks.py",
    "POOR_RESIDUAL": "gelpolight_core/measurement/fit_checks.py",
    "LARGEST_SD": "gelpolight_core/measurement/fit_checks.py",
    "SMALLEST_GROUND": "gelpolight_core/measurement/fit_checks.py",
    "FLAGGED_SHARE": "gelpolight_core/measurement/tool.py",
    "PRESSED_SHARE": "gelpolight_core/image/in_time.py",
    "CONTACT_CHANGE": "gelpolight_core/image/in_time.py",
    "SATURATED_WARN": "app/live/image_checks.py",
    "SATURATED_FAIL": "app/live/image_checks.py",
    "DARK_SHARE_OF_SCALE": "app/live/image_checks.py",
}


@dataclass(frozen=True)
class Judged:
    """A figure as the source judges it; limits are expressions of the module."""

    module: str
    key: str
    unit: str
    warn: str
    fail: str
    higher_is_better: bool

    def __str__(self) -> str:
        """Return where it is, for a test's name."""
        return f"{self.module}:{self.key}"


@dataclass(frozen=True)
class Row:
    """A row of the chapter."""

    key: str
    warn: str
    fail: str


def figures_of(path: Path) -> Iterator[Judged]:
    """Return the figures that a module judges, by its text."""
    module = str(path.relative_to(ROOT))
    for call in ast.walk(ast.parse(path.read_text("utf-8"))):
        if not (isinstance(call, ast.Call) and isinstance(call.func, ast.Name)):
            continue
        named = {k.arg: ast.unparse(k.value) for k in call.keywords}
        if (
            call.func.id == "judge"
            and len(call.args) >= 3
            and not isinstance(call.args[0], ast.Name)
        ):
            unit = call.args[3].value if len(call.args) > 3 else ""  # type: ignore[attr-defined]
            warn, fail = named.get("warn", "None"), named.get("fail", "None")
            high = named.get("higher_is_better") == "True"
            yield Judged(module, _key(call.args[0]), unit, warn, fail, high)
        if call.func.id == "guarded":
            limits = "limit - expanded", "limit + expanded"
            yield Judged(module, _key(call.args[0]), "%", *limits, False)
        if call.func.id == "judge_left_out":
            yield Judged(module, ast.literal_eval(call.args[0]), "", "0.0", "None", False)
        if call.func.id == "figure" and module.endswith("reflectance/indentation.py"):
            key, unit = (ast.literal_eval(call.args[n]) for n in (0, 2))
            warn, fail = (ast.unparse(call.args[n]) for n in (3, 4))
            yield Judged(module, key, unit, warn, fail, key in HIGHER_IS_BETTER)


def _key(expression: ast.expr) -> str:
    """Return a figure's key, with * for what is filled in."""
    if isinstance(expression, ast.Constant):
        return str(expression.value)
    assert isinstance(expression, ast.JoinedStr)
    return "".join(
        str(part.value) if isinstance(part, ast.Constant) else "*" for part in expression.values
    )


@cache
def all_figures() -> tuple[Judged, ...]:
    """Return the figures of core and program."""
    found = []
    for folder in ("gelpolight_core", "app"):
        for path in sorted((ROOT / folder).rglob("*.py")):
            if str(path.relative_to(ROOT)) != "gelpolight_core/finding.py":
                found += figures_of(path)
    return tuple(found)


@cache
def rows() -> dict[str, list[Row]]:
    """Return the chapter's rows by the modules that the lines above their tables name."""
    found: dict[str, list[Row]] = {}
    modules: list[str] = []
    for section in re.split(r"^## ", CHAPTER, flags=re.MULTILINE)[1:]:
        head, _, table = section.partition("\n| figure |")
        modules = re.findall(r"`((?:gelpolight_core|app)/[\w/]+\.py)`", head)
        listed = []
        for line in table.partition("\n\n")[0].splitlines():
            _, figure, limits, *_ = (cell.strip() for cell in line.split("|"))
            key = re.search(r"`([\w*]+)`", figure)
            if key is not None:
                warn, _, fail = (
                    limits.rpartition(" / ") if limits != NOTHING else (NOTHING, "", NOTHING)
                )
                listed.append(Row(key[1], warn, fail))
        for module in modules:
            found.setdefault(module, []).extend(listed)
    return found


def limit_text(figure: Judged, expression: str) -> str | float:
    """Return what the chapter has to say of a limit: a number, or words."""
    if expression == "None":
        return NOTHING
    # A limit that some figures have: the chapter states it, and the text says when it is left out.
    expression = re.sub(r"^None if .+ else ", "", expression)
    names = dict(vars(importlib.import_module(figure.module.removesuffix(".py").replace("/", "."))))
    for node in ast.walk(ast.parse((ROOT / figure.module).read_text("utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:  # also those inside a function
            module = importlib.import_module(node.module)
            names |= {
                a.name: getattr(module, a.name) for a in node.names if hasattr(module, a.name)
            }
    try:
        return float(eval(expression, dict(names)))
    except NameError:
        words = IN_WORDS[expression]
        filled = {f"100{name}": 100.0 * names[name] for name in names if name.startswith("L")
                  and isinstance(names[name], float)}  # fmt: skip
        return words.format(**{**names, **filled}) if "{" in words else words


@pytest.mark.parametrize("figure", all_figures(), ids=str)
def test_the_chapter_states_every_figure_with_its_limits(figure: Judged) -> None:
    """A limit that is changed in the source is changed in the chapter."""
    listed = [row for row in rows().get(figure.module, []) if row.key == figure.key]
    wanted = [limit_text(figure, x) for x in (figure.warn, figure.fail)]
    sign = "<" if figure.higher_is_better else ">"
    for row in listed:
        if all(map(_says, (row.warn, row.fail), wanted, 2 * [sign], 2 * [figure.unit])):
            return
    pytest.fail(f"{figure} wants {sign} {wanted} {figure.unit}, the chapter has {listed}")


def _says(cell: str, limit: str | float, sign: str, unit: str) -> bool:
    if limit == NOTHING:
        return cell == NOTHING
    if isinstance(limit, str):
        return cell == f"{sign} {limit}"
    number = re.fullmatch(rf"{sign} (\d+(?:\.(\d+))?)(?: (\S+))?", cell)
    if number is None or (number[3] or "") != unit:
        return False
    return float(number[1]) == round(limit, len(number[2] or ""))


def test_every_row_of_the_chapter_is_a_figure_of_its_module() -> None:
    """What was taken out of the program is taken out of the chapter."""
    known = {(figure.module, figure.key) for figure in all_figures()}
    modules = {figure.module for figure in all_figures()}
    assert set(rows()) - modules <= {str(path) for path in NOTES.values()}
    for section in {tuple(found) for found in rows().values() if found}:
        sharing = [module for module, found in rows().items() if tuple(found) == section]
        for row in section:
            assert any((module, row.key) in known for module in sharing), row


def test_a_calibration_has_no_figure_that_the_chapter_leaves_out(
    small_calibration: Calibration,
) -> None:
    """The source's text may be read wrongly; what comes out of it cannot be."""
    patterns = {row.key for found in rows().values() for row in found}
    figures = [f for table in small_calibration.quality.values() for f in table.figures]
    assert len(figures) > 40
    for figure in figures:
        assert figure.key in patterns
        assert _known(figure), figure


def _known(figure: Finding) -> bool:
    """Return whether the limits of a made figure are those of one that was read in the source."""
    for judged in all_figures():
        if judged.key != figure.key:
            continue
        limits = zip(
            (judged.warn, judged.fail), (figure.warn_limit, figure.fail_limit), strict=True
        )
        if all(_same(limit_text(judged, text), value) for text, value in limits):
            return True
    return False


def _same(stated: str | float, value: float | None) -> bool:
    if isinstance(stated, str):
        return (value is None) == (stated == NOTHING)
    return value is not None and math.isclose(stated, value)


@pytest.mark.parametrize("name", NOTES)
def test_notes_and_faults_are_stated_with_the_limits_of_the_source(name: str) -> None:
    """The sentences beside a depth map or a measurement, too, have limits that are explained."""
    module: Any = importlib.import_module(NOTES[name].removesuffix(".py").replace("/", "."))
    percent = f"{100.0 * getattr(module, name):g} %"
    before = CHAPTER[: CHAPTER.index(f"`{name}`")]
    sentence = before[before.rindex("|") :] if "|" in before[-120:] else before[-120:]
    assert re.search(rf"(?<![\d.]){re.escape(percent)}", sentence), (name, percent, sentence)


def test_the_limits_of_a_validation_are_those_of_a_new_installation() -> None:
    """The chapter says when a calibration counts as validated, and when as old."""
    # By its text: the module needs a window library, which this folder does without.
    source = (ROOT / "app/services/preferences.py").read_text("utf-8")
    age_days = re.search(r"^    age_days: float = number\(([\d.]+)", source, re.M)
    assert age_days is not None
    text = " ".join(CHAPTER.split())
    size_percent, height_percent = TOLERANCE_PERCENT
    assert f"height is right to {height_percent:g} % and its size to {size_percent:g} %" in text
    assert f"older than {float(age_days[1]):g} days" in text
    assert f"Below f = {NEEDED_FREEDOM} ({100.0 * SD_ERROR:g} %" in text


@pytest.mark.parametrize("flag", FLAG_NAMES)
def test_every_flag_is_explained(flag: str) -> None:
    """People meet the flags in files and in Inspect."""
    assert f"| `{flag}` |" in CHAPTER
