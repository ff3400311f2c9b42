"""The report is complete, self-contained, and printable."""

from __future__ import annotations

import base64
import re
import subprocess
from dataclasses import replace
from functools import cache
from html.parser import HTMLParser
from pathlib import Path
from shutil import which

import cv2
import numpy as np
import pytest
import scene
from hypothesis import given
from hypothesis import strategies as st

from app.command_line.main import MENDABLE, main
from gelpolight_core.calibration.edit import edited
from gelpolight_core.calibration.file import write_calibration
from gelpolight_core.calibration.pipeline import CalibrationRun
from gelpolight_core.calibration.scatter import gather_scatter
from gelpolight_core.quality import Figure, QualityTable, Verdict, judge
from gelpolight_core.report.build import calibration_report, run_report
from gelpolight_core.report.document import Report, limit_text
from gelpolight_core.report.html import report_html
from gelpolight_core.report.pdf import line_width_mm, report_pdf, wrap
from gelpolight_core.report.stage_facts import stage_facts
from gelpolight_core.report.typeface import printable
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.session.session import read_session

NASTY = '<script src="http://evil.example/x.js">&"\'$\\frac{1}$ \u4e2d\u6587'


class Page(HTMLParser):
    """Collects the tags and the visible text."""

    def __init__(self) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.seen: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Note the tag."""
        self.tags.append((tag, dict(attrs)))

    def handle_data(self, data: str) -> None:
        """Note the text."""
        self.seen.append(data)


def parsed(report: Report) -> Page:
    """Return the report's HTML, read."""
    page = Page()
    page.feed(report_html(report))
    return page


@cache
def small() -> Calibration:
    """Return a calibration of the small sensor."""
    return scene.calibration()


@pytest.fixture(scope="module")
def whole(virtual_run: CalibrationRun, virtual_session: Path) -> Report:
    """Return the whole report of the virtual session."""
    return run_report(virtual_run, read_session(virtual_session))


def test_the_report_shows_every_stage_with_figures_and_a_drawing(
    virtual_run: CalibrationRun, whole: Report
) -> None:
    assert [s.key for s in whole.sections] == list(virtual_run.calibration.quality)
    shown = " ".join(parsed(whole).seen)
    for section in whole.sections:
        # The drawings of background and balls are in the sections on factors and reflectance.
        assert section.drawings or section.key in ("background", "balls"), section.key
        for figure in virtual_run.calibration.quality[section.key].figures:
            assert figure.label in shown


def test_every_source_is_listed_with_its_hash(virtual_run: CalibrationRun, whole: Report) -> None:
    shown = set(parsed(whole).seen)
    for name, digest in virtual_run.calibration.provenance.sources.items():
        assert {name, digest} <= shown


def test_the_html_needs_no_other_file(whole: Report) -> None:
    """It is mailed, archived, and opened on machines without a network."""
    text = report_html(whole)
    assert "<script" not in text
    assert "url(" not in text and "@import" not in text
    for tag, attributes in parsed(whole).tags:
        assert tag not in ("link", "iframe", "object", "embed")
        for name in ("src", "href"):
            target = attributes.get(name)
            assert target is None or target.startswith(("data:image/png;base64,", "#")), target


def test_the_drawings_are_complete(whole: Report) -> None:
    images = [a["src"] for tag, a in parsed(whole).tags if tag == "img"]
    assert len(images) == sum(len(s.drawings) for s in whole.sections)
    for source in images:
        assert source is not None
        data = np.frombuffer(base64.b64decode(source.split(",")[1]), np.uint8)
        image = cv2.imdecode(data, cv2.IMREAD_COLOR)
        assert image.std() > 5.0  # something is drawn on it


def test_a_calibration_without_known_objects_is_reported_as_not_validated(whole: Report) -> None:
    assert any("Not validated" in text for text in parsed(whole).seen)


def test_too_few_presses_to_hold_any_out_are_reported(
    virtual_calibration: Calibration,
) -> None:
    """Nothing was compared: there is neither a loss nor a verdict on the refinement."""
    full = virtual_calibration.full
    assert full is not None
    assert "Loss on held-out presses" in dict(stage_facts(virtual_calibration, "joint"))
    few = replace(virtual_calibration, full=replace(full, held_out=(0.0, 1.0), kept="mirror"))
    facts = dict(stage_facts(few, "joint"))
    assert "too few presses" in facts["LEDs used"]
    assert "Loss on held-out presses" not in facts


def test_names_from_files_are_shown_and_never_obeyed() -> None:
    c = small()
    hostile = replace(
        c,
        sensor=replace(c.sensor, serial=NASTY),
        provenance=replace(c.provenance, operator=NASTY, sources={NASTY: NASTY}),
        quality={NASTY: QualityTable((judge(NASTY, NASTY, 2.0, NASTY, warn=1.0, advice=NASTY),))},
    )
    report = calibration_report(hostile)
    page = parsed(report)
    assert "script" not in {tag for tag, _ in page.tags}
    assert NASTY in page.seen
    assert report_pdf(report).startswith(b"%PDF")


def test_edits_by_hand_are_reported() -> None:
    """A curve drawn by hand is not a measurement."""
    c = small()
    curve = (np.linspace(0.0, 1.0, 11), np.linspace(0.0, 1.0, 11) ** 1.2)
    changed = edited(c, {1: curve}, operator="A. Person", made="2026-03-04T05:06:07+00:00")
    shown = " ".join(parsed(calibration_report(changed)).seen)
    assert "Edited by hand" in shown
    assert "green" in shown and "A. Person" in shown and "2026-03-04" in shown
    assert "Edited by hand" not in " ".join(parsed(calibration_report(c)).seen)


def test_a_figure_that_did_not_pass_comes_with_its_advice() -> None:
    advice = "Press harder"
    table = QualityTable((judge("a", "A", 2.0, "mm", warn=1.0, fail=3.0, advice=advice),))
    report = calibration_report(replace(small(), quality={"lens": table}))
    assert report.verdict is Verdict.WARN
    shown = "".join(parsed(report).seen)
    assert shown.count(advice) == 2  # in the summary, and beside the figure
    assert "Warning" in shown


@given(
    value=st.floats(-10, 10),
    warn=st.floats(-5, 5),
    gap=st.floats(0.1, 5),
    higher=st.booleans(),
    with_fail=st.booleans(),
)
def test_a_limit_is_shown_on_the_side_where_it_is_judged(
    value: float, warn: float, gap: float, higher: bool, with_fail: bool
) -> None:
    fail = (warn - gap if higher else warn + gap) if with_fail else None
    figure = judge("k", "l", value, warn=warn, fail=fail, higher_is_better=higher)
    if not with_fail and value == warn:
        return  # at its only limit the direction of the figure is unknown
    sign = "\N{GREATER-THAN OR EQUAL TO}" if higher else "\N{LESS-THAN OR EQUAL TO}"
    assert limit_text(figure).startswith(sign)


def test_a_figure_that_is_only_reported_has_no_limit() -> None:
    assert limit_text(Figure("k", "l", 1.0, "", None, None, Verdict.PASS, "")) == ""


@given(st.text(max_size=120), st.floats(8.0, 180.0))
def test_lines_fit_their_column_and_lose_no_word(text: str, width_mm: float) -> None:
    lines = wrap(text, width_mm, 8.0)
    for line in lines:
        assert len(line) == 1 or line_width_mm(line, 8.0) <= width_mm
    assert "".join(lines).replace(" ", "") == printable(text).replace(" ", "")


def test_the_pdf_is_of_a4_pages_with_its_text_to_search(whole: Report, tmp_path: Path) -> None:
    path = tmp_path / "r.pdf"
    path.write_bytes(report_pdf(whole))
    boxes = re.findall(rb"/MediaBox \[ ?0 0 ([\d.]+) ([\d.]+)", path.read_bytes())
    assert len(boxes) > 3
    for width, height in boxes:
        assert float(width) == pytest.approx(595.3, abs=0.5)
        assert float(height) == pytest.approx(841.9, abs=0.5)
    if which("pdftotext") is None:
        pytest.skip("pdftotext is not installed")
    text = subprocess.run(
        ["pdftotext", str(path), "-"], capture_output=True, text=True, check=True
    ).stdout
    for section in whole.sections:
        assert section.title in text


def test_the_same_report_gives_the_same_file() -> None:
    report = calibration_report(small())
    assert report_html(report) == report_html(report)
    assert report_pdf(report) == report_pdf(report)


def test_the_scatter_is_what_the_curves_were_fitted_to(
    virtual_run: CalibrationRun, virtual_session: Path
) -> None:
    scatter = gather_scatter(virtual_run, read_session(virtual_session))
    assert scatter.names == tuple(p.name for p in virtual_run.reflectance.presses)
    for k, fit in enumerate(virtual_run.reflectance.fits):
        off = (
            scatter.values[k] / virtual_run.reflectance.table.response(k, scatter.cosines[k]) - 1.0
        )
        # The spread is the robust standard deviation of exactly that; the factors were fed back
        # once.
        assert 1.4826 * np.median(np.abs(off)) == pytest.approx(fit.spread, rel=0.1)
        assert set(np.unique(scatter.presses[k])) == set(range(len(scatter.names)))


def test_the_command_writes_both_kinds_from_a_calibration(
    virtual_calibration: Calibration, tmp_path: Path
) -> None:
    source = tmp_path / "c.gplcal"
    write_calibration(virtual_calibration, source)
    for name in ("r.html", "r.pdf"):
        assert main(["report", str(source), "-o", str(tmp_path / name)]) == 0
        assert (tmp_path / name).stat().st_size > 10_000


def test_the_command_refuses_what_it_cannot_write_before_any_work(
    virtual_session: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["report", str(virtual_session), "-o", str(tmp_path / "r.doc")]) == MENDABLE
    assert "HTML or PDF" in capsys.readouterr().err
    missing = tmp_path / "none" / "r.html"
    assert main(["report", str(virtual_session), "-o", str(missing)]) == MENDABLE
    assert "folder does not exist" in capsys.readouterr().err
