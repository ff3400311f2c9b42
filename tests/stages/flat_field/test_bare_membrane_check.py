"""Objects on the membrane are detected by the background stage, as by the live hint."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from app.calibrate.detection_marks import read_raw
from app.calibrate.light_steps import detect_background
from gelpolight_core.calibration.open_sensor_recipe import TOP_POSE
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.calibration.stage_status import StageState, StageStatus


def with_background(project: CalibrationProject, source: Path) -> StageStatus:
    """Replace the background of the session by another image, with new noise."""
    (old,) = project.session.found("background")
    image = cv2.imread(str(source), cv2.IMREAD_UNCHANGED)
    noise = np.random.default_rng(2).normal(0.0, 0.6, image.shape)
    assert cv2.imwrite(str(old), np.clip(np.round(image + noise), 0, 255).astype(np.uint8))
    return project.compute("background")


def test_the_bare_membrane_passes_and_its_figures_are_shown(computed_project):
    project = computed_project()
    status = with_background(project, project.session.found("background")[0])
    assert status.state is StageState.PASS
    assert status.quality["pressed"].value == 0.0


@pytest.mark.parametrize("what", ["cylinder", "ball", "whiteboard"])
def test_what_the_live_hint_sees_the_stage_sees(what, computed_project, small_session):
    project = computed_project()
    session = project.session
    source = {
        "cylinder": small_session / "presses" / "cylinder_s5_d100.png",
        "ball": session.found("balls")[0],
        "whiteboard": session.found("whiteboard")[0],
    }[what]
    status = with_background(project, source)
    # The ball presses show whether a spot is touched or has another coating.
    assert status.state is (StageState.FAIL if what == "whiteboard" else StageState.WARN)
    live = detect_background(
        read_raw(session.found("background")[0]),
        table=project.results[TOP_POSE].table,
        whiteboard=read_raw(session.found("whiteboard")[0]),
    )
    assert not live.good
    if what == "whiteboard":
        assert "same as the whiteboard image" in status.sentence
    else:
        assert status.quality["pressed"].value > 0.0
        stage = status.quality[live.finding.key]
        assert live.finding.verdict is stage.verdict
        assert live.finding.value == pytest.approx(stage.value, abs=0.5)
