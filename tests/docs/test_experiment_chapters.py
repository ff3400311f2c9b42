"""The chapters on speed and error hold what their script makes."""

from __future__ import annotations

import importlib.util
import re
import sys
from pathlib import Path
from types import ModuleType

import pytest

from gelpolight_core.design_check.lighting import LightingRow
from gelpolight_core.experiments.front.measure import Point
from gelpolight_core.experiments.front.quiet import Machine
from gelpolight_core.experiments.integrators.measure import IntegratorPoint
from gelpolight_core.experiments.leave_out import RuleFigure

DOCS = Path(__file__).resolve().parents[2] / "docs"


@pytest.fixture(scope="module")
def chapters() -> ModuleType:
    spec = importlib.util.spec_from_file_location("chapters", DOCS / "scripts" / "chapters.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules["chapters"] = module
    spec.loader.exec_module(module)
    return module


def point(method: str, family: str, width: int, ms: float, um: float) -> Point:
    sizes = {"sensor": "virtual-matt", "method": method, "label": method, "family": family}
    errors = {"rms_um": um, "rms_low_um": 0.8 * um, "rms_high_um": 1.2 * um, "normal_deg": 1.0}
    return Point(
        **sizes, width=width, megapixels=0.75e-6 * width**2, pitch_mm=20.0 / width, median_ms=ms,
        p95_ms=1.2 * ms, height_percent=0.5, size_percent=0.2, presses=4, **errors,
    )  # fmt: skip


@pytest.fixture
def figures(chapters: ModuleType) -> object:
    points = [
        point(method, family, width, ms * width / 320, um * 320 / width)
        for width in (320, 640, 1280)
        for method, family, ms, um in (
            ("full_fast", "effort", 2.0, 9.0),
            ("full_best", "effort", 20.0, 4.0),
            ("table", "rival", 1.0, 90.0),
        )
    ]
    integrators = [
        IntegratorPoint("sine_4", "sine", scene, scene, side, 1.0, 2.0, 4e5 / side**4, 0.1)
        for scene, side in (("bump", 40), ("bump", 80), ("bump", 160), ("wedge", 160))
    ]
    return chapters.Figures(
        tuple(points),
        tuple(integrators),
        (RuleFigure("virtual-matt", "beside", "the field beside", "best", 8.0, 16.0, 3.0, 0.5, 4),),
        (LightingRow("point", 13.75, 12.0, 0.2, 7.9, 165.8, -2.0, 52.0),),
        {"paper": [{"name": "image to depth", "median_ms": 4.0}]},
        Machine(2, "system", "3.12", 0.0, 4.0, ()),
    )


def test_every_part_is_in_a_chapter_and_every_marker_has_its_part(chapters: ModuleType) -> None:
    used = [
        mark[1]
        for name in chapters.CHAPTERS
        for mark in chapters.MARK.findall((DOCS / name).read_text("utf-8"))
    ]
    assert set(used) == set(chapters.PARTS)


def test_the_parts_state_the_figures(chapters: ModuleType, figures: object) -> None:
    text = {name: part(figures) for name, part in chapters.PARTS.items()}
    assert "4 % of one" in text["machine"]
    assert "alone in 0 of 3" in text["front"] and "table is on the front" in text["front"]
    assert "| **full_best** | 80.0 | 96.0 | 1.0 (0.8 - 1.2)" in text["sensors"]
    assert "1.00 ± 0.00" in text["sensors"] and "4.00 ± 0.00" in text["integrators"]
    assert "| 50 | 3 | 0.5 |" in text["rules"]
    assert "| 7.9 | 165.8 |" in text["lighting"]
    assert "1280 (1.2 MP)" in text["sizes"] and "80 ms (65 ms/MP)" in text["sizes"]


def test_outside_the_markers_no_run_time_is_stated(chapters: ModuleType) -> None:
    for name in chapters.CHAPTERS:
        text = chapters.MARK.sub("", (DOCS / name).read_text("utf-8"))
        assert re.findall(r"\d+(?:\.\d+)? ms\b(?!\.)", text) in ([], ["33 ms"]), name


def test_the_diagrams_are_those_that_the_chapters_show() -> None:
    pages = "".join(page.read_text("utf-8") for page in DOCS.rglob("*.md"))
    shown = set(re.findall(r"diagrams/([\w.-]+)\)", pages))
    made = list((DOCS / "diagrams").glob("*"))
    assert shown == {path.name for path in made}
    assert all(path.stat().st_size < 100_000 for path in made)


def test_writing_twice_gives_the_same_chapters(
    chapters: ModuleType, figures: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    for name in chapters.CHAPTERS:
        (tmp_path / name).write_text((DOCS / name).read_text("utf-8"), "utf-8")
    monkeypatch.setattr(chapters, "DOCS", tmp_path)
    chapters.write(figures)
    once = [(tmp_path / name).read_text("utf-8") for name in chapters.CHAPTERS]
    chapters.write(figures)
    assert once == [(tmp_path / name).read_text("utf-8") for name in chapters.CHAPTERS]
    assert "| **full_best** |" in once[0]
    names = {path.name for path in (tmp_path / "diagrams").iterdir()}
    assert names == {"front-virtual-matt.webp", "integrators.webp"}
