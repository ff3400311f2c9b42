"""A press that disagrees with the others is named, with the cause and the value that fits."""

import numpy as np
import pytest

from app.calibrate.ball_steps import judge_ball
from gelpolight_core.base.finding import Verdict
from gelpolight_core.calibration.open_ball_stages import BALLS, REFLECTANCE
from gelpolight_core.calibration.open_sensor_recipe import LIGHTS, RADIANCE, TOP_POSE
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.calibration.recipe import StageResults
from gelpolight_core.calibration.stage_status import StageState, StageStatus
from gelpolight_core.session.decisions import PlacedCircle
from gelpolight_core.stages.balls.ball_press import contact_mask
from gelpolight_core.stages.balls.press_agreement import PressAgreement, compare_presses

Map = np.ndarray
ODD = "ball_01.png"


def compared(results: StageResults, images: tuple[Map, ...]) -> tuple[PressAgreement, ...]:
    return compare_presses(
        results[BALLS].presses,
        images,
        results[TOP_POSE].table,
        results[LIGHTS].leds.led_positions_mm,
        results[RADIANCE],
        results[REFLECTANCE].factors.factors,
    )


def recomputed(project: CalibrationProject) -> StageStatus:
    project.compute("balls")
    return project.compute("reflectance")


def test_good_presses_agree_with_each_other(small_project):
    results = small_project.results
    found = compared(results, results[BALLS].images)
    assert len(found) == len(results[BALLS].presses)
    assert [a.fault for a in found] == [None] * len(found)
    assert max(a.radius_off_percent for a in found) < 8.0
    assert max(a.odd_share for a in found) < 0.05


@pytest.mark.parametrize("stated", [8.0, 3.0])
def test_a_wrong_radius_fails_the_step_and_the_right_one_is_offered(stated, computed_project):
    """The ball has a radius of 4 mm."""
    project = computed_project()
    project.set_ball_radius(ODD, stated)
    status = recomputed(project)
    assert status.state is StageState.FAIL
    assert status.quality["press_radius_percent"].verdict is Verdict.FAIL
    assert ODD.removesuffix(".png") in status.sentence
    reflectance = project.results[REFLECTANCE].table
    (odd,) = [a for a in reflectance.agreements if a.fault]
    assert odd.name.endswith(ODD)
    assert odd.radius_mm == pytest.approx(4.0, rel=0.08)
    assert "diameter" in odd.remedy
    presses = project.session.found("balls")
    assert [p.name for p in presses if judge_ball(p.name, project).verdict == "fail"] == [ODD]
    project.set_ball_radius(ODD, 4.0)
    assert recomputed(project).quality["press_radius_percent"].verdict is Verdict.PASS


def test_a_misplaced_circle_is_named(computed_project):
    project = computed_project()
    results = project.results
    press = next(p for p in results[BALLS].presses if p.name.endswith(ODD))
    rows, columns = np.nonzero(contact_mask(press, results[TOP_POSE].table))
    u = float(results[TOP_POSE].table.u_px[rows, columns].mean())
    v = float(results[TOP_POSE].table.v_px[rows, columns].mean())
    radius = float(np.ptp(results[TOP_POSE].table.u_px[rows, columns]) / 2.0)
    project.place_ball(ODD, PlacedCircle(u + radius, v, 1.3 * radius))
    status = recomputed(project)
    assert status.state is not StageState.PASS
    reflectance = project.results[REFLECTANCE].table
    assert [a.name for a in reflectance.agreements if a.fault] == [f"balls/{ODD}"]


def test_dirt_on_a_contact_is_named(small_project):
    results = small_project.results
    mask = contact_mask(results[BALLS].presses[1], results[TOP_POSE].table)
    columns = np.nonzero(mask)[1]
    mask[:, : int(np.quantile(columns, 0.7))] = False
    dirty = results[BALLS].images[1].copy()
    dirty[mask] *= 0.4
    images = (results[BALLS].images[0], dirty, *results[BALLS].images[2:])
    (odd,) = [a for a in compared(results, images) if a.fault]
    assert odd.name.endswith(ODD)
    assert "dirt" in odd.remedy
