"""What no ball touches must look as in the background; what differs in every image is named."""

import re
import shutil
from collections.abc import Callable

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from gelpolight_core.base.errors import InputError
from gelpolight_core.base.finding import Finding, Verdict
from gelpolight_core.calibration.open_ball_stages import BALLS
from gelpolight_core.calibration.open_sensor_recipe import BACKGROUND
from gelpolight_core.calibration.project import run_stage
from gelpolight_core.calibration.recipes import FULL
from gelpolight_core.calibration.stage_status import StageState
from gelpolight_core.session.session import read_session
from gelpolight_core.simulation.indenters import BallIndenter, CuboidIndenter, CylinderIndenter
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.simulation.simulated_session import pressed_membrane
from gelpolight_core.simulation.virtual_sensor import BareMembrane, VirtualSensor

SENSOR = VirtualSensor(SensorDesign().scaled(0.25), 0)
Judged = Callable[[NDArray[np.number]], list[Finding]]


@pytest.fixture
def judged(small_project, tmp_path):
    """Return a function that gives the findings about another background of the small session."""

    def findings(background: NDArray[np.number]) -> list[Finding]:
        folder = shutil.copytree(small_project.session.folder, tmp_path / "session")
        pixels = np.clip(np.rint(background[..., ::-1]), 0, 255)
        cv2.imwrite(str(folder / "background" / "background.png"), pixels)
        session, results = read_session(folder), small_project.results
        for stage in (BACKGROUND, BALLS):
            results = run_stage(FULL, stage, session, results)
            stage.require(results)
        return [f for f in results[BALLS].background if f.verdict is not Verdict.PASS]

    return findings


def bare() -> NDArray[np.float64]:
    return SENSOR.frame(BareMembrane(), averaged=8, stream="background").astype(np.float64)


@pytest.mark.function("See that something touched the membrane in the background of a calibration")
@pytest.mark.parametrize(
    ("indenter", "x_mm", "y_mm"),
    [
        (CylinderIndenter(6.0, 0.05), -4.0, 4.0),
        (CuboidIndenter(12.0, 0.05), 0.0, 0.0),
        (BallIndenter(8.0, 0.5), 12.0, 3.0),
    ],
)
def test_a_press_in_the_background_is_named_with_its_place(judged, indenter, x_mm, y_mm):
    state = pressed_membrane(SENSOR.design, indenter, x_mm=x_mm, y_mm=y_mm)
    (found,) = judged(SENSOR.frame(state, averaged=8, stream="background"))

    place = [float(number) for number in re.findall(r"-?\d+\.\d", found.remedy)]
    assert np.abs(np.subtract(place, (x_mm, y_mm))).max() < indenter.reach_mm + 1.0


def test_a_grain_of_dust_in_the_background_is_named_with_its_place(judged):
    away = np.hypot(SENSOR.rays.x_mm + 5.0, SENSOR.rays.y_mm - 1.0)
    (found,) = judged(bare() * (1.0 - 0.5 * (away < 0.2))[..., None])

    place = [float(number) for number in re.findall(r"-?\d+\.\d", found.remedy)]
    assert np.abs(np.subtract(place, (-5.0, 1.0))).max() < 0.5


@pytest.mark.parametrize(
    ("gain", "room_light", "verdict"), [(0.98, 0.0, Verdict.WARN), (1.0, 1.0, Verdict.FAIL)]
)
def test_a_background_in_other_light_is_named(judged, gain, room_light, verdict):
    (found,) = judged(bare() * gain + room_light)

    assert (found.key, found.verdict) == ("background_light_percent", verdict)


def test_where_no_ball_is_found_the_background_is_named_first(judged):
    with pytest.raises(InputError, match=r"background: .*Light of the ball presses"):
        judged(0.8 * bare() + 30.0)


def test_a_true_background_is_not_suspected(judged):
    assert not judged(bare())


SPOT_MM, SPOT_RADIUS_MM = (-5.0, 4.0), 1.2


def darkened(image: NDArray[np.number], mask: NDArray[np.bool_]) -> NDArray[np.number]:
    return np.where(mask[..., None], np.rint(0.4 * image), image).astype(image.dtype)


def worn_spot() -> NDArray[np.bool_]:
    x_mm, y_mm = SPOT_MM
    return np.hypot(SENSOR.rays.x_mm - x_mm, SENSOR.rays.y_mm - y_mm) < SPOT_RADIUS_MM


def printed_dots() -> NDArray[np.bool_]:
    x_mm, y_mm = ((np.asarray(a) + 2.0) % 4.0 - 2.0 for a in (SENSOR.rays.x_mm, SENSOR.rays.y_mm))
    return np.hypot(x_mm, y_mm) < 0.5


def painted(project, mask: NDArray[np.bool_], *folders: str):
    """Darken a part of the membrane in some images, and compute the stages up to the balls."""
    for folder in folders:
        for path in project.session.found(folder):
            cv2.imwrite(str(path), darkened(cv2.imread(str(path)), mask))
    before = project.compute(BACKGROUND.key)
    project.compute(BALLS.key)
    return before, project.statuses()


@pytest.mark.function("Use a gel with a worn coating or printed dots")
@pytest.mark.parametrize("mask", [worn_spot, printed_dots])
def test_a_spot_that_the_ball_presses_show_too_is_the_coating(computed_project, mask):
    before, after = painted(computed_project(), mask(), "background", "balls")

    assert (before.state, before.quality["pressed"].verdict) == (StageState.WARN, Verdict.WARN)
    assert after[BACKGROUND.key].state is StageState.PASS
    coating = after[BALLS.key].quality["coating_percent"]
    assert coating.verdict is Verdict.PASS
    assert coating.value == pytest.approx(before.quality["pressed"].value, rel=0.3)


def test_a_spot_of_the_background_alone_is_a_touch(computed_project):
    before, after = painted(computed_project(), worn_spot(), "background")

    assert before.quality["pressed"].verdict is Verdict.WARN
    balls = after[BALLS.key].quality
    for key in ("pressed", "background_place_percent"):
        assert balls[key].verdict is Verdict.FAIL
        place = [float(number) for number in re.findall(r"-?\d+\.\d", balls[key].remedy)]
        assert np.abs(np.subtract(place, SPOT_MM)).max() < SPOT_RADIUS_MM
    assert "coating_percent" not in {figure.key for figure in balls.figures}
