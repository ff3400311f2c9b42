"""A ball with a wrong stated diameter is named, with the diameter that fits the other presses."""

from dataclasses import replace

import pytest
from test_real_sensors import real_session

from gelpolight_core.base.finding import Verdict
from gelpolight_core.calibration.closed_sensor_recipe import BALLS
from gelpolight_core.calibration.closed_sensor_stages import SlopesStageResult, find_slopes
from gelpolight_core.session.session import Session

FIGURE = "press_radius_percent"


def with_diameter(session: Session, name: str, diameter_mm: float) -> SlopesStageResult:
    """Return the slopes of a session of which one diameter is stated so."""
    radii_mm = {path.name: session.ball_radius_mm(path.name) for path in session.files("balls")}
    session = replace(session, ball_radii_mm={**radii_mm, name: 0.5 * diameter_mm})
    return find_slopes(session, session.averaged("background"))


def test_right_diameters_are_not_doubted(closed_run, shared_data):
    assert closed_run.results[BALLS].quality[FIGURE].verdict is Verdict.PASS
    mini = real_session(shared_data, "mini-1")
    assert find_slopes(mini, mini.averaged("background")).quality[FIGURE].verdict is Verdict.PASS


@pytest.mark.function(
    "Learn which ball of a closed sensor has a wrong diameter, and the one that fits"
)
@pytest.mark.parametrize(
    ("name", "stated_mm", "right_mm"),
    [("ball_00.png", 8.0, 6.0), ("ball_07.png", 6.0, 8.0), ("ball_01.png", 10.0, 8.0)],
)
def test_a_wrong_ball_of_each_size_is_named(closed_session, name, stated_mm, right_mm):
    found = with_diameter(closed_session, name, stated_mm)
    figure = found.quality[FIGURE]
    assert figure.verdict is Verdict.WARN
    assert name.removesuffix(".png") in figure.remedy and f"fit {right_mm:g} mm" in figure.remedy


def test_a_wrong_ball_that_is_left_out_is_named_with_its_size(closed_session):
    found = with_diameter(closed_session, "ball_01.png", 6.0)
    assert "fit 8 mm" in found.result.refused["ball_01.png"].found
    assert found.quality[FIGURE].verdict is Verdict.PASS


@pytest.mark.parametrize(
    ("name", "stated_mm", "right_mm"),
    [("ball_00.png", 9.4, 12.7), ("ball_30.png", 12.7, 9.5)],
)
def test_a_wrong_ball_of_a_real_sensor_is_named(shared_data, name, stated_mm, right_mm):
    found = with_diameter(real_session(shared_data, "mini-1"), name, stated_mm)
    assert found.quality[FIGURE].verdict is Verdict.WARN
    assert (found.sizes[0].name, found.sizes[0].proposed_mm) == (name, right_mm)
