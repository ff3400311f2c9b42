"""The stability report as its reader meets it: every quick case is right or refused."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.command_line.main import MENDABLE, main
from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.errors import InputError
from gelpolight_core.experiments import stability_sessions
from gelpolight_core.experiments.sensitivity import parameters, sensitivities
from gelpolight_core.experiments.stability import (
    Case,
    ModeSeen,
    Outcome,
    Seen,
    run_case,
    run_cases,
)
from gelpolight_core.experiments.stability_cases import all_cases
from gelpolight_core.experiments.stability_report import result_rows, write_stability
from gelpolight_core.experiments.stability_sessions import LENGTHS, LengthCost, state_wrongly
from gelpolight_core.experiments.stability_trial import judged, standard_press, standard_sensor
from gelpolight_core.simulation.session import session_toml

CASES = all_cases()
# One of each kind of hard thing; the command runs all of them.
QUICK = (
    "pixels_huge",
    "light_2_percent",
    "kind_uint8",
    "patch_two_dark",
    "leds_0.5_mm_apart",
    "leds_0.5_mm_below",
    "leds_in_a_row_10_deg",
    "depth_4_mm",
    "everywhere_dark",
    "index_2.5",
    "distortion_-0.6",
    "factor_zero",
    "table_not_monotone",
    "crosstalk_singular",
    "plane_backwards",
    "brighter_than_the_table",
    "threads_full",
)


@pytest.mark.parametrize(
    "case",
    [c for c in CASES if c.name in QUICK or (c.subject == "grids" and c.quick)],
    ids=lambda case: case.name,
)
def test_an_extreme_case_is_right_or_refused(case: Case) -> None:
    result = run_case(case)
    assert result.outcome is not Outcome.FAILED, result.summary
    assert result.summary


def test_pixels_that_are_no_number_leave_the_rest_of_the_map_alone() -> None:
    result = run_case(next(case for case in CASES if case.name == "pixels_nan"))
    assert result.seen is not None
    assert result.seen.error_um is not None
    assert result.seen.error_um < 2.0
    assert set(dict(result.seen.flags)) == {"invalid"}


def test_the_papers_model_says_where_shadows_leave_its_assumptions() -> None:
    for name, says in (("wall_57_deg", False), ("cone_89_deg", True)):
        result = run_case(next(case for case in CASES if case.name == name))
        assert result.outcome is not Outcome.FAILED, result.summary
        assert ("shadow of an LED" in result.summary) is says


def test_names_are_one_each() -> None:
    assert len({case.name for case in CASES}) == len(CASES)
    assert set(QUICK) <= {case.name for case in CASES}


def _case(run) -> Case:  # type: ignore[no-untyped-def]
    return Case("x", "subject", "what", "required", run)


def test_a_crash_is_a_row_that_failed_and_the_next_case_runs() -> None:
    def crash() -> Seen:
        raise ZeroDivisionError("by nothing")

    def refuse() -> Seen:
        raise InputError("it is bent", where="here", advice="Straighten it")

    results = run_cases([_case(crash), _case(refuse)])
    assert [r.outcome for r in results] == [Outcome.FAILED, Outcome.REFUSED]
    assert "by nothing" in results[0].summary and "Straighten it" in results[1].summary


@pytest.mark.parametrize(
    ("seen", "outcome"),
    [
        (Seen(True, "", error_um=1.0, bound_um=2.0), Outcome.PASSED),
        (Seen(True, "", error_um=3.0, bound_um=2.0), Outcome.FAILED),
        (Seen(True, "", error_um=3.0, bound_um=2.0, warning="do not trust it"), Outcome.REFUSED),
        (Seen(True, "", error_um=float("nan"), bound_um=2.0), Outcome.FAILED),
        (Seen(True, "", finite=False, warning="do not trust it"), Outcome.FAILED),
        (Seen(False, ""), Outcome.FAILED),
    ],
)
def test_a_wrong_result_passes_only_as_refused_by_itself(seen: Seen, outcome: Outcome) -> None:
    assert run_case(_case(lambda: seen)).outcome is outcome


@pytest.mark.parametrize(
    ("modes", "outcome"),
    [
        ([ModeSeen("best", 1.0, 2.0), ModeSeen("fast", 1.0, 2.0)], Outcome.PASSED),
        ([ModeSeen("best", 1.0, 2.0), ModeSeen("fast", 3.0, 2.0)], Outcome.FAILED),
        ([ModeSeen("best", 1.0, 2.0), ModeSeen("fast", 3.0, 2.0, "note")], Outcome.REFUSED),
        ([ModeSeen("best", 3.0, 2.0, "note"), ModeSeen("fast", 3.0, 2.0)], Outcome.FAILED),
        ([ModeSeen("best", None, None, "nothing is pressed")], Outcome.REFUSED),
    ],
)
def test_a_case_ends_as_its_worst_mode(modes: list[ModeSeen], outcome: Outcome) -> None:
    result = run_case(_case(lambda: Seen(True, "seen", modes=tuple(modes))))
    assert result.outcome is outcome


def test_an_image_is_tried_in_every_mode() -> None:
    seen = judged(standard_sensor(), standard_press(), 8.0)
    assert {mode.mode for mode in seen.modes} == {"best", "balanced", "fast", "paper"}
    row = result_rows([run_case(_case(lambda: seen))])[0]
    assert all(row[f"{mode.mode}_um"] == pytest.approx(mode.error_um) for mode in seen.modes)


@pytest.mark.parametrize("length", LENGTHS, ids=lambda length: length.key)
def test_each_stated_length_is_stated_wrongly_alone(length, tmp_path: Path) -> None:  # type: ignore[no-untyped-def]
    path = tmp_path / "session.toml"
    before = session_toml(standard_sensor().sensor.design)
    path.write_text(before)
    state_wrongly(length, 5.0, tmp_path)
    changed = [
        (a, b)
        for a, b in zip(before.splitlines(), path.read_text().splitlines(), strict=True)
        if a != b
    ]
    assert len(changed) == (
        len(standard_sensor().sensor.design.balls) if "ball" in length.key else 1
    )
    for a, b in changed:
        old, new = (float(line.split("=")[1]) for line in (a, b))
        assert new == pytest.approx(1.05 * old, rel=1e-4)


def test_a_sensor_that_is_calibrated_from_small_images_is_measured_in_every_mode(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    whole = SensorDesign()
    fewer = replace(whole, balls=whole.balls[:5])
    monkeypatch.setattr(stability_sessions, "SensorDesign", lambda: fewer)
    case = next(c for c in CASES if c.name == "session_scale_0.25")
    result = run_case(case)
    assert result.outcome is not Outcome.FAILED, result.summary
    assert result.seen is not None and len(result.seen.modes) == 4
    assert result.seen.condition is not None and result.seen.condition > 1.0


def test_the_report_says_what_one_per_cent_of_a_length_costs(tmp_path: Path) -> None:
    costs = [LengthCost(LENGTHS[0], -1.5, 0.25, "pass")]
    write_stability([], [], costs, tmp_path)
    found = json.loads((tmp_path / "stability.json").read_text())["lengths"]
    assert found == [
        {
            "length": "led_height",
            "height_percent_per_percent": -1.5,
            "size_percent_per_percent": 0.25,
            "verdict": "pass",
        }
    ]
    assert "-1.50" in (tmp_path / "stability.html").read_text()


def test_ctrl_c_stops_the_cases() -> None:
    def stop() -> Seen:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_cases([_case(stop)])


def test_numbers_that_are_none_stay_out_of_the_json() -> None:
    result = run_case(_case(lambda: Seen(True, "", error_um=float("nan"))))
    assert json.dumps(result_rows([result]), allow_nan=False)


def test_the_depth_answers_to_leds_as_the_shading_says_and_not_to_light() -> None:
    """Nearer light falls off faster. A change of light is measured and corrected."""
    chosen = [p for p in parameters() if p.name in ("leds_z", "factors")]
    found = {s.parameter.name: s for s in sensitivities(standard_sensor(), chosen=chosen)}
    assert np.sign(found["leds_z"].low_percent) == -np.sign(found["leds_z"].high_percent)
    assert found["factors"].swing_percent < 0.1 * found["leds_z"].swing_percent


def test_the_report_holds_every_case_that_was_asked_for(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert main(["stability", "-o", str(out), "--only", "grid_127x131,kind_int8,slopes_1e4"]) == 0
    captured = capsys.readouterr()
    assert "2 passed, 1 refused" in captured.out
    assert "%" in captured.err  # progress
    rows = json.loads((out / "stability.json").read_text())["cases"]
    assert {row["case"]: row["verdict"] for row in rows} == {
        "kind_int8": "refused",
        "grid_127x131": "passed",
        "slopes_1e4": "passed",
    }
    with (out / "stability.csv").open() as stream:
        assert [row["case"] for row in csv.DictReader(stream)] == [row["case"] for row in rows]
    page = (out / "stability.html").read_text()
    assert page.count("data:image/png") == 1 and "int8" in page


def test_an_unknown_case_is_refused_before_the_work(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["stability", "-o", str(tmp_path / "out"), "--only", "nothing"]) == MENDABLE
    assert "nothing" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
