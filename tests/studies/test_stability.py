"""The stability report as its reader meets it: every quick case is right or refused."""

import csv

import pytest

from app.cli.main import MENDABLE, main
from gelpolight_core.base.errors import InputError
from gelpolight_core.studies.image_case_helpers import (
    measure_all_modes,
    standard_press,
    standard_sensor,
)
from gelpolight_core.studies.stability import (
    Case,
    CaseMeasurement,
    CaseOutcome,
    ModeResult,
    run_case,
)
from gelpolight_core.studies.stability_cases import all_cases
from tests.studies.extreme_inputs import input_cases

CASES = (*all_cases(), *input_cases())
RIGHT, WRONG = ModeResult("best", True, 1.0, 2.0), ModeResult("fast", False, 3.0, 2.0)
REPORTED = ModeResult("paper", False, None, warning="nothing is pressed")
# One of each kind of hard thing; the command and the script run all of them.
QUICK = (
    "pixels_huge",
    "light_2_percent",
    "kind_uint8",
    "patch_two_dark",
    "leds_0.5_mm_apart",
    "leds_0.5_mm_below",
    "leds_10_deg_off_a_row",
    "depth_4_mm",
    "light_zero_everywhere",
    "index_2.5",
    "distortion_-0.6",
    "factor_zero",
    "curve_falling",
    "crosstalk_singular",
    "plane_behind_camera",
    "light_beyond_curve",
    "threads_full",
)


@pytest.mark.function("`gelpolight stability`: stiff and extreme cases")
@pytest.mark.parametrize("case", [c for c in CASES if c.name in QUICK], ids=lambda case: case.name)
def test_an_extreme_case_is_right_or_refused(case):
    result = run_case(case)
    assert result.outcome is not CaseOutcome.FAILED, result.message
    assert result.message


def test_pixels_that_are_no_number_leave_the_rest_of_the_map_alone():
    result = run_case(next(case for case in CASES if case.name == "pixels_nan"))
    assert result.first.error_um is not None and result.first.error_um < 2.0
    assert result.seen.flags.startswith("invalid") and "," not in result.seen.flags


def test_the_papers_model_says_where_shadows_leave_its_assumptions():
    for name, says in (("wall_57_deg", False), ("cone_89_deg", True)):
        result = run_case(next(case for case in CASES if case.name == name))
        assert result.outcome is not CaseOutcome.FAILED, result.message
        assert ("shadow of an LED" in result.message) is says


def _case(run) -> Case:  # type: ignore[no-untyped-def]
    return Case("subject", "x", "required", run)


def test_a_crash_is_a_row_that_failed_and_a_refusal_has_its_reason():
    def crash() -> CaseMeasurement:
        raise ZeroDivisionError("by nothing")

    def refuse() -> CaseMeasurement:
        raise InputError("it is bent", where="here", advice="Straighten it")

    results = [run_case(_case(crash)), run_case(_case(refuse))]
    assert [r.outcome for r in results] == [CaseOutcome.FAILED, CaseOutcome.REFUSED]
    assert "by nothing" in results[0].message and "Straighten it" in results[1].message


@pytest.mark.parametrize(
    ("seen", "outcome"),
    [
        (CaseMeasurement("", (RIGHT, RIGHT)), CaseOutcome.PASSED),
        (CaseMeasurement("", (RIGHT, WRONG)), CaseOutcome.FAILED),
        (CaseMeasurement("", (RIGHT, REPORTED)), CaseOutcome.REFUSED),
        (CaseMeasurement("", (REPORTED, WRONG)), CaseOutcome.FAILED),
    ],
)
def test_a_wrong_result_counts_as_refused_only_where_every_wrong_mode_reports_it(seen, outcome):
    assert run_case(_case(lambda: seen)).outcome is outcome


def test_an_image_is_tried_in_every_mode():
    seen = measure_all_modes(standard_sensor(), standard_press(), 8.0)
    assert [mode.name for mode in seen.modes] == ["best", "balanced", "fast", "paper"]
    row = run_case(_case(lambda: seen)).row
    assert all(row[f"{mode.name}_um"] == mode.error_um for mode in seen.modes)


def test_the_table_and_the_figure_hold_every_case_that_was_asked_for(tmp_path, capsys):
    out = tmp_path / "out"
    names = "pixels_huge,index_2.5,all_black"
    assert main(["stability", "-o", str(out), "--only", names]) == 0
    captured = capsys.readouterr()
    assert "2 passed, 1 refused" in captured.out
    assert "%" in captured.err  # progress
    with (out / "stability.csv").open() as stream:
        verdicts = {row["case"]: row["verdict"] for row in csv.DictReader(stream)}
    assert verdicts == {
        "pixels_huge": "passed",
        "index_2.5": "passed",
        "all_black": "refused",
    }
    assert (out / "stability.png").read_bytes().startswith(b"\x89PNG")


def test_an_unknown_case_is_refused_before_the_work(tmp_path, capsys):
    assert main(["stability", "-o", str(tmp_path / "out"), "--only", "nothing"]) == MENDABLE
    assert "nothing" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
