"""The report is complete, printable, and readable by programs."""

import re
import subprocess
from dataclasses import replace
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from shutil import which

import numpy as np
import pytest
import scene
from hypothesis import given, settings
from hypothesis import strategies as st
from report_pdf import report_data, report_text

from app.cli.main import MENDABLE, main
from gelpolight_core.base.compared_quantity import Quantity
from gelpolight_core.base.finding import QualityTable, Verdict, judge
from gelpolight_core.base.root_causes import MODEL
from gelpolight_core.calibration.annotations import write_validation
from gelpolight_core.calibration.calibration_file import write_calibration
from gelpolight_core.calibration.refinement_parameters import TERMS
from gelpolight_core.calibration.reflectance_edit import with_edited_curves
from gelpolight_core.measurement.result import MeasuredPress, Measurement
from gelpolight_core.output.report.calibration_report import calibration_report
from gelpolight_core.output.report.certificate import measurement_report
from gelpolight_core.output.report.document import Report, TextTable
from gelpolight_core.output.report.facts import head_facts, stage_facts
from gelpolight_core.output.report.report_pdf_file import report_pdf, write_report
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.sensor.sensor_calibration import Calibration
from gelpolight_core.session.reference_object import ReferenceObject
from gelpolight_core.session.validation import Validation

NASTY = (
    '#panic("x") *b* $1/0$ <l> @r \\u{41} `raw` // /* \u4e2d\u6587 \udcff \x00 "q"\n= h ' + 90 * "w"
)
"""Markup of typst, characters without a glyph, and a word longer than a column."""


@cache
def small() -> Calibration:
    """Return a calibration of the small sensor."""
    return scene.calibration()


@pytest.fixture(scope="module")
def whole(small_run):
    """Return the whole report of the small session."""
    return calibration_report(small_run.calibration, small_run)


@pytest.fixture(scope="module")
def whole_file(whole, tmp_path_factory):
    """Return the file of the whole report."""
    path = tmp_path_factory.mktemp("report") / "report.pdf"
    write_report(whole, path)
    return path


def written(report: Report, folder: Path) -> Path:
    """Write a report into a folder; return its path."""
    write_report(report, folder / "r.pdf")
    return folder / "r.pdf"


@pytest.mark.function("Read the numbers of a report with a program")
def test_programs_find_every_figure_of_every_stage_in_the_file(small_run, whole_file):
    data = report_data(whole_file)
    quality = small_run.calibration.quality
    assert [section["key"] for section in data["sections"]] == ["result", *quality]
    for section in data["sections"][1:]:
        found = {figure["key"]: figure["value"] for figure in section["figures"]}
        assert found == {f.key: f.value for f in quality[section["key"]].figures}
    calibration = data["data"]["calibration"]
    assert calibration["identity"] == small_run.calibration.identity
    leds = np.array(calibration["led_positions_mm"])
    assert (leds == small_run.calibration.data.led_positions_mm).all()


def test_the_pages_show_every_figure_drawing_and_source(small_run, whole, whole_file):
    text = report_text(whole_file)
    for section in whole.sections:
        # Background and balls are drawn in the sections on factors and reflectance.
        shown = section.drawings or section.key in ("background", "balls", "crosstalk", "joint")
        assert shown, section.key
        assert section.title in text
        for figure in section.quality.figures:
            assert figure.text[:30] in text  # its first line
        for drawing in section.drawings:
            assert drawing.caption in text
            assert "<path" in drawing.svg
    for name, digest in small_run.calibration.provenance.sources.items():
        assert name in text and digest in text
    assert "Not validated" in text


def test_the_pages_are_a4(whole_file):
    if which("pdfinfo") is None:
        pytest.skip("pdfinfo is not installed")
    output = subprocess.check_output(["pdfinfo", str(whole_file)], text=True)
    assert "(A4)" in output
    assert "Calibration of sensor" in output


def test_a_report_is_an_archive_file_with_its_data(whole_file):
    content = whole_file.read_bytes()
    # ISO 19005-3, its colours and the attached file are declared; typst refuses what breaks them.
    for mark in (b"pdfaid:part>3<", b"pdfaid:conformance>B<", b"/GTS_PDFA1", b"/AFRelationship"):
        assert mark in content
    assert len(content) < 5e6


def test_a_report_says_which_terms_held_out_presses_ask_for(small_calibration):
    full = small_calibration.data.full
    assert full is not None
    terms = {**full.membrane.terms, "stretch_loss": 0.12}
    changed = replace(
        full,
        membrane=replace(full.membrane, terms=terms),
        membrane_sd={**full.membrane_sd, "stretch_loss": 0.01},
        worth={"stretch": 0.0234, "lobe": 0.0002},
    )
    facts = facts_of_terms(small_calibration.changed(full=changed))
    name_by_key = {term.key: term.name.lower() for term in TERMS}
    stretch, lobe = (facts[name_by_key[key]] for key in ("stretch", "lobe"))
    assert "0.12" in stretch and "2.3 %" in stretch and "0.01" in stretch
    assert "left out" in lobe and "< 0.1 %" in lobe
    # A calibration by an earlier program has none of this.
    assert not facts_of_terms(small_calibration.changed(full=replace(full, worth={})))


def facts_of_terms(c: Calibration) -> dict[str, str]:
    """Return what a report says of each term, by its name in lower case."""
    names = {term.name.lower() for term in TERMS}
    facts = stage_facts(c)["joint"]
    return {name.lower(): text for name, text in facts if name.lower() in names}


def test_texts_from_files_are_shown_and_never_obeyed(tmp_path):
    c = small()
    figure = judge(NASTY, NASTY, float("nan"), NASTY, warn=1.0, remedy=NASTY)
    hostile = replace(
        c.changed(sensor=replace(c.data.sensor, serial=NASTY)),
        provenance=replace(c.provenance, operator=NASTY, created=NASTY, sources={NASTY: NASTY}),
        quality={NASTY: QualityTable((figure,))},
    )
    path = written(calibration_report(hostile), tmp_path)
    _, section = report_data(path)["sections"]
    assert section["figures"][0]["label"] == NASTY.replace("\udcff", "?")
    assert section["figures"][0]["value"] is None and section["verdict"] == "fail"
    assert '#panic("x") *b* $1/0$ <l> @r' in report_text(path)


@settings(max_examples=12)
@given(st.text(max_size=60))
def test_any_text_can_be_reported(text):
    assert report_pdf(Report(text, Verdict.PASS, (), facts=((text, text),))).startswith(b"%PDF")


def test_edits_by_hand_are_reported():
    """A curve drawn by hand is not a measurement."""
    c = small()
    curve = (np.linspace(0.0, 1.0, 11), np.linspace(0.0, 1.0, 11) ** 1.2)
    changed = with_edited_curves(
        c, {1: curve}, operator="A. Person", made="2026-03-04T05:06:07+00:00"
    )
    shown = dict(head_facts(changed))["Edited by hand"]
    assert "green" in shown and "A. Person" in shown and "2026-03-04" in shown
    assert "Edited by hand" not in dict(head_facts(c))


def test_a_figure_that_did_not_pass_comes_with_its_advice(tmp_path):
    advice = "Press harder"
    tables = {
        "lens": QualityTable((judge("a", "A", 2.0, "mm", warn=1.0, fail=3.0, remedy=advice),)),
        "balls": QualityTable((judge("b", "B", 0.5, "mm", warn=1.0, remedy="Never shown"),)),
    }
    report = calibration_report(replace(small(), quality=tables))
    assert report.verdict is Verdict.WARN
    text = report_text(written(report, tmp_path))
    assert text.count(advice) == 2  # in the summary, and beside the figure
    assert "Warning" in text and "Never shown" not in text
    assert "\N{LESS-THAN OR EQUAL TO} 1 mm (fails > 3)" in text


@given(
    value=st.floats(-10, 10),
    warn=st.floats(-5, 5),
    gap=st.floats(0.1, 5),
    higher=st.booleans(),
    with_fail=st.booleans(),
)
def test_a_limit_is_shown_on_the_side_where_it_is_judged(value, warn, gap, higher, with_fail):
    fail = (warn - gap if higher else warn + gap) if with_fail else None
    figure = judge("k", "l", value, warn=warn, fail=fail, higher_is_better=higher)
    if not with_fail and value == warn:
        return  # at its only limit the direction of the figure is unknown
    sign = "\N{GREATER-THAN OR EQUAL TO}" if higher else "\N{LESS-THAN OR EQUAL TO}"
    assert figure.limit_text.startswith(sign)


@pytest.mark.parametrize(
    ("size_mm", "verdict"),
    [(0.0, None), (2.0, "pass"), (2.04, "warn")],  # 2 % off conforms, but En is 2
)
def test_a_certificate_passes_only_what_was_compared(size_mm, verdict, tmp_path):
    axis, flat = np.arange(-4.0, 5.0), np.zeros((9, 9), np.float32)
    heightmap = HeightMap(
        flat, axis, axis, 1.0, None, flat.astype(np.uint8), "A-1", "full", "p.png"
    )
    sd = {"diameter_mm": 0.01, "height_mm": 0.01, "centre_mm": (0.01, 0.01), "drape_decay_mm": 0.1}
    ball = Measurement(
        shape="ball", diameter_mm=2.0, side_mm=None, height_mm=1.0, centre_mm=(0.0, 0.0),
        yaw_deg=None, drape_decay_mm=0.5, sd=sd, edge_radius_mm=None, blur_mm=None,
        baseline_mm=0.0, residual_rms_mm=0.001, outline_mm=np.zeros((3, 2)),
    )  # fmt: skip
    truth = ReferenceObject("ball", size_mm)
    time = datetime(2026, 3, 1, 10, tzinfo=UTC)
    press = MeasuredPress("p.png", "ab", heightmap, ball, truth, time)
    report = measurement_report(small(), [press])
    assert (report.verdict, bool(report.cause)) == (verdict, verdict != "pass")
    measured = datetime.fromisoformat(dict(report.sections[0].facts)["Measured"]).astimezone()
    assert measured == time, "not when it was printed"
    assert dict(report.facts)["Verdict of the calibration"] == small().verdict.word
    assert dict(report.sections[0].facts)["SHA-256 of the image"] == "ab"
    path = written(report, tmp_path)
    assert report_data(path)["verdict"] == verdict
    badge = {"pass": "\N{CHECK MARK} Pass", "warn": "! Warning", None: "No decision"}[verdict]
    assert report_text(path).startswith(f"{report.title} {badge}")


def test_a_long_name_stays_in_its_column(tmp_path):
    columns = 11
    rows = tuple(("cylinder_s500_h100_same_1.png", *["0.0000"] * (columns - 1)) for _ in range(3))
    listing = TextTable("Every press", tuple(f"deviation {k}" for k in range(columns)), rows)
    path = written(Report("R", Verdict.PASS, (), listings=(listing,)), tmp_path)
    boxes = subprocess.check_output(["pdftotext", "-bbox", str(path), "-"], text=True)
    words = re.findall(r'xMin="([\d.]+)" yMin="[\d.]+" xMax="([\d.]+)".*?>(.*)</word>', boxes)
    left_of_numbers = min(float(left) for left, _, word in words if word == "0.0000")
    names = [float(right) for _, right, word in words if word.replace("\u200b", "").endswith("png")]
    assert len(names) == len(rows) and max(names) < left_of_numbers


def test_the_same_report_gives_the_same_file():
    assert report_pdf(calibration_report(small())) == report_pdf(calibration_report(small()))


def test_the_command_states_the_validation_of_the_window(small_calibration, tmp_path):
    source = tmp_path / "c.gplcal"
    write_calibration(small_calibration, source)
    lengths = (Quantity("height", 1.2, truth=1.0, limit_percent=8.0),)
    identity = small_calibration.identity
    # As the Validation step of the wizard keeps it.
    write_validation(
        Validation(identity, "2026-01-02T03:04:05+00:00", "M", "cylinder", lengths), source
    )
    assert main(["report", str(source), "-o", str(tmp_path / "r.pdf")]) == 0
    data = report_data(tmp_path / "r.pdf")
    assert data["validation"]["sentence"].startswith("Validation failed: cylinder")
    assert data["validation"]["verdict"] == "fail"
    assert data["validation"]["data"]["comparisons"][0]["measured_mm"] == 1.2
    assert "Not validated" not in report_text(tmp_path / "r.pdf")


def test_the_command_refuses_what_it_cannot_write_before_any_work(small_session, tmp_path, capsys):
    assert main(["report", str(small_session), "-o", str(tmp_path / "r.html")]) == MENDABLE
    line = capsys.readouterr().err
    assert "must end in .pdf" in line
    missing = tmp_path / "none" / "r.pdf"
    assert main(["report", str(small_session), "-o", str(missing)]) == MENDABLE
    assert "folder does not exist" in capsys.readouterr().err


def test_the_most_likely_cause_is_first_and_what_follows_from_it_has_no_remedy(tmp_path):
    poor = [judge(key, key, 2.0, warn=1.0, remedy="Coat it again") for key in MODEL]
    calibration = replace(small(), quality={"joint": QualityTable(tuple(poor))})
    text = " ".join(report_text(written(calibration_report(calibration), tmp_path)).split())
    assert text.index("Most likely cause: Check the LED height.") < text.index("Not validated")
    assert "Coat it again" not in text
