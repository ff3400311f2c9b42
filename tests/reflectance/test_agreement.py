"""A press that disagrees with the others is named, with the cause and the value that fits."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from app.calibrate.balls import judge_ball
from gelpolight_core.calibration.inputs import Stage
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.calibration.results import StageResults
from gelpolight_core.calibration.status import StageState, StageStatus
from gelpolight_core.finding import Verdict
from gelpolight_core.reflectance.agreement import PressAgreement, compare_presses
from gelpolight_core.reflectance.press import contact_mask
from gelpolight_core.session.decisions import PlacedCircle

Map = np.ndarray
ODD = "ball_01.png"


def compared(results: StageResults, images: tuple[Map, ...]) -> tuple[PressAgreement, ...]:
    assert results.table is not None and results.lights is not None
    assert results.radiance is not None and results.factors is not None
    return compare_presses(
        results.presses,
        images,
        results.table,
        results.lights.led_positions_mm,
        results.radiance,
        results.factors.factors,
    )


def recomputed(project: CalibrationProject) -> StageStatus:
    project.compute(Stage.BALLS)
    return project.compute(Stage.REFLECTANCE)


def test_good_presses_agree_with_each_other(small_project: CalibrationProject) -> None:
    results = small_project.results
    found = compared(results, results.images)
    assert len(found) == len(results.presses)
    assert [a.fault for a in found] == [""] * len(found)
    assert max(a.radius_off_percent for a in found) < 8.0
    assert max(a.odd_share for a in found) < 0.05


@pytest.mark.parametrize("stated", [8.0, 3.0])
def test_a_wrong_radius_fails_the_step_and_the_right_one_is_offered(
    stated: float, computed_project: Callable[[], CalibrationProject]
) -> None:
    """The ball has a radius of 4 mm."""
    project = computed_project()
    project.set_ball_radius(ODD, stated)
    status = recomputed(project)
    assert status.state is StageState.FAIL
    assert status.quality["press_radius_percent"].verdict is Verdict.FAIL
    assert ODD in status.sentence
    reflectance = project.results.reflectance
    assert reflectance is not None
    (odd,) = [a for a in reflectance.agreements if a.fault]
    assert odd.name.endswith(ODD)
    assert odd.radius_mm == pytest.approx(4.0, rel=0.08)
    assert "radius" in odd.fault
    presses = project.session.found("balls")
    assert [p.name for p in presses if judge_ball(p.name, project)[0] == "fail"] == [ODD]
    project.set_ball_radius(ODD, 4.0)
    assert recomputed(project).quality["press_radius_percent"].verdict is Verdict.PASS


def test_a_misplaced_circle_is_named(computed_project: Callable[[], CalibrationProject]) -> None:
    project = computed_project()
    results = project.results
    assert results.table is not None
    press = next(p for p in results.presses if p.name.endswith(ODD))
    rows, columns = np.nonzero(contact_mask(press, results.table))
    u = float(results.table.u_px[rows, columns].mean())
    v = float(results.table.v_px[rows, columns].mean())
    radius = float(np.ptp(results.table.u_px[rows, columns]) / 2.0)
    project.place_ball(ODD, PlacedCircle(u + radius, v, 1.3 * radius))
    status = recomputed(project)
    assert status.state is not StageState.PASS
    reflectance = project.results.reflectance
    assert reflectance is not None
    assert [a.name for a in reflectance.agreements if a.fault] == [f"balls/{ODD}"]


def test_dirt_on_a_contact_is_named(small_project: CalibrationProject) -> None:
    results = small_project.results
    assert results.table is not None
    mask = contact_mask(results.presses[1], results.table)
    columns = np.nonzero(mask)[1]
    mask[:, : int(np.quantile(columns, 0.7))] = False
    dirty = results.images[1].copy()
    dirty[mask] *= 0.4
    images = (results.images[0], dirty, *results.images[2:])
    (odd,) = [a for a in compared(results, images) if a.fault]
    assert odd.name.endswith(ODD)
    assert "dirt" in odd.fault
