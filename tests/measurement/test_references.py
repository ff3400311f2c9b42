"""References with their uncertainty, and the decision on what was measured beside them."""

import math
import re
from dataclasses import replace
from datetime import date, timedelta

import pytest

from gelpolight_core.base.compared_quantity import Quantity
from gelpolight_core.base.errors import InputError
from gelpolight_core.base.finding import Verdict
from gelpolight_core.lab.reference_press import read_truth
from gelpolight_core.measurement.statistics import missing_repeats
from gelpolight_core.session.description import write_description
from gelpolight_core.session.reference_object import ReferenceObject
from gelpolight_core.session.session import read_session

SESSION = """format = "gelpolight-session"
version = 1
[sensor]
serial = "A-1"
[in_place]
mm_per_px = 0.06
[balls]
default = 3.0
[indenters."Pin 5"]
shape = "cylinder"
diameter_mm = 5.002
diameter_sd_mm = 0.001
height_mm = 1.0
edge_radius_mm = 0.15
certificate = "K-2041"
due = "2027-03-31"
serial = "7"
"""
PIN = ReferenceObject(
    "cylinder",
    5.002,
    size_expanded_mm=0.002,
    height_mm=1.0,
    edge_radius_mm=0.15,
    certificate="K-2041",
    due="2027-03-31",
    serial="7",
)


def compared(value: float, sd: float | None, truth_sd: float | None = None) -> Quantity:
    """Return a size beside 5 mm, with a tolerance of 5 %, which is 0.25 mm."""
    return Quantity("diameter_mm", value, sd, 5.0, 5.0, truth_sd)


@pytest.mark.function("Decide by the uncertainty whether an object conforms")
@pytest.mark.parametrize(
    ("value", "decision"),
    [
        (5.0, Verdict.PASS),
        (5.14, Verdict.PASS),  # 0.25 less 0.1 mm
        (5.16, Verdict.WARN),
        (5.34, Verdict.WARN),
        (5.36, Verdict.FAIL),  # 0.25 and 0.1 mm
        (4.64, Verdict.FAIL),
    ],
)
def test_the_tolerance_is_narrower_by_the_uncertainty_for_conformity_and_wider_against_it(
    value, decision
):
    assert compared(value, 0.04, 0.03).verdict is decision


def test_a_deviation_beyond_both_uncertainties_is_not_explained():
    explained, wrong = compared(5.09, 0.04, 0.03), compared(5.11, 0.04, 0.03)
    assert (explained.verdict, wrong.verdict) == (Verdict.PASS, Verdict.PASS)
    assert [len(one.findings) for one in (explained, wrong)] == [1, 2]
    assert wrong.judgement.startswith(explained.judgement.replace("0.90", "1.10"))
    assert wrong.judgement != explained.judgement.replace("0.90", "1.10")


def test_without_a_stated_uncertainty_the_tolerance_alone_decides():
    assert compared(5.249, None).verdict is Verdict.PASS
    assert compared(5.251, None).verdict is Verdict.FAIL
    assert compared(5.1, None).en is None
    assert Quantity("diameter_mm", 5.1, 0.01).verdict is None


def test_a_tolerance_below_the_uncertainty_decides_nothing_near_the_reference():
    assert compared(5.0, 0.2).verdict is Verdict.WARN


def test_en_is_the_deviation_over_both_expanded_uncertainties():
    assert compared(5.05, 0.04, 0.03).en == pytest.approx(0.05 / 0.1)
    assert compared(4.95, 0.04).en == pytest.approx(0.05 / 0.08)


@pytest.mark.function("Read the uncertainty budget of a deviation")
def test_the_budget_adds_up_to_the_uncertainty_of_the_deviation():
    parts = (("noise", 0.01), ("calibration", 0.02), ("model", 0.02))
    found = Quantity("diameter_mm", 5.0, 0.05, 5.0, 5.0, 0.03, parts)
    assert [source for source, _ in found.budget] == [
        "noise",
        "calibration",
        "model",
        "fit",
        "reference",
    ]
    assert dict(found.budget)["fit"] == pytest.approx(0.04)
    assert 2.0 * math.hypot(*(sd for _, sd in found.budget)) == pytest.approx(
        found.deviation_expanded
    )
    plain = found.as_json()
    assert plain["true_expanded"] == 0.06 and plain["decision"] == "conforms"


@pytest.mark.function(
    "State a reference with uncertainty, edge radius, certificate and due day, in truth.csv"
)
def test_a_reference_is_read_with_what_its_certificate_states(tmp_path):
    (tmp_path / "truth.csv").write_text(
        "file,shape,diameter_mm,side_mm,height_mm,diameter_sd_mm,height_sd_mm,edge_radius_mm,"
        "edge_radius_sd_mm,certificate,due,serial\n"
        "a.png,cylinder,5.002,,1,0.001,0.002,0.15,0.01,K-1,2027-03-31,7\n"
        "b.png,cuboid,,4,1,,,,,,,\n"
    )
    first, second = read_truth(tmp_path).rows
    assert first.truth == replace(
        PIN, height_expanded_mm=0.004, edge_radius_expanded_mm=0.02, certificate="K-1"
    )
    assert second.truth == ReferenceObject("cuboid", 4.0, height_mm=1.0)


@pytest.mark.function("Name indenters in session.toml and use them in truth.csv")
def test_a_press_takes_its_reference_from_an_indenter_of_the_session(tmp_path):
    (tmp_path / "session.toml").write_text(SESSION)
    presses = tmp_path / "presses"
    presses.mkdir()
    (presses / "truth.csv").write_text("file,indenter,height_mm\na.png,Pin 5,\nb.png,Pin 5,0.5\n")
    first, second = read_truth(presses).rows
    assert first.truth == PIN
    assert second.truth.height_mm == 0.5 and second.truth.certificate == "K-2041"
    (presses / "truth.csv").write_text("file,indenter\na.png,Pin 6\n")
    with pytest.raises(InputError, match="line 2: 'Pin 6' is not an indenter"):
        read_truth(presses)


def test_a_session_that_is_written_again_keeps_its_indenters(tmp_path):
    (tmp_path / "session.toml").write_text(SESSION)
    session = read_session(tmp_path)
    write_description(session)
    assert read_session(tmp_path).indenters == session.indenters
    assert session.indenters["Pin 5"]["diameter_mm"] == 5.002


def test_an_unknown_statement_about_an_indenter_is_refused(tmp_path):
    (tmp_path / "session.toml").write_text(SESSION.replace('serial = "7"', 'colour = "red"'))
    with pytest.raises(InputError, match="colour"):
        read_session(tmp_path)


@pytest.mark.function("Hear that the calibration of a reference has ended")
def test_a_reference_says_that_its_calibration_has_ended():
    today = date.today()
    assert replace(PIN, due=today.isoformat()).findings() == ()
    (found,) = replace(PIN, due=(today - timedelta(days=1)).isoformat()).findings()
    assert (found.key, found.verdict) == ("reference_due", Verdict.WARN)
    assert "K-2041" in found.text
    (found,) = ReferenceObject("ball", 5.0, due="2020-01-31").findings()
    assert "  " not in found.text
    assert ReferenceObject("cylinder", 5.0, height_mm=1.0).findings() == ()


def test_a_due_day_that_is_none_is_refused(tmp_path):
    (tmp_path / "truth.csv").write_text(
        "file,shape,diameter_mm,height_mm,due\na.png,ball,5,1,next May\n"
    )
    with pytest.raises(InputError, match="'next May' is not a day"):
        read_truth(tmp_path)


def test_a_standard_deviation_needs_nine_repeats_to_be_known_to_a_quarter():
    assert [missing_repeats(count - 1) for count in (1, 5, 8, 9, 25)] == [8, 4, 1, 0, 0]


def test_a_deviation_without_known_uncertainty_does_not_claim_to_have_none():
    unknown = Quantity("height_mm", 1.02, None, 1.0, 8.0)
    stated = Quantity("height_mm", 1.02, 0.01, 1.0, 8.0)
    assert "uncertainty unknown" in unknown.sentence and "0.00 %" not in unknown.sentence
    assert "+2.00 % \N{PLUS-MINUS SIGN} 2.00 %" in stated.sentence


def test_all_uncertainties_of_a_comparison_have_the_coverage_factor_that_it_states():
    compared = Quantity("diameter_mm", 4.974, 0.078, 5.0, 5.0)
    numbers = [float(n) for n in re.findall(r"± ([\d.]+)", compared.sentence)]
    length_mm, percent = numbers
    assert length_mm == pytest.approx(2.0 * 0.078, abs=0.005)
    assert percent == pytest.approx(100.0 * length_mm / 5.0, abs=0.1)
    assert compared.sentence.count("k = 2") == 1
