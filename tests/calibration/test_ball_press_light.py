"""Each ball press of an open sensor has its own light, which is made that of the background."""

import shutil

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from gelpolight_core.base.finding import QualityTable, Verdict, judge
from gelpolight_core.base.root_causes import best_cause
from gelpolight_core.calibration.ball_press_light import undo_light_change
from gelpolight_core.calibration.open_ball_stages import BALLS, BallsStageResult
from gelpolight_core.calibration.open_sensor_recipe import BACKGROUND
from gelpolight_core.calibration.project import run_stage
from gelpolight_core.calibration.recipes import FULL
from gelpolight_core.health.frame_health import LightGain
from gelpolight_core.session.session import read_session


@pytest.fixture
def balls_in_light(small_project, tmp_path):
    """Return a function that gives the balls of the small session in changed light.

    It takes the gain of each channel (presses, 3) or of each row (presses, rows, 1, 1), and the
    room light of each press in grey levels. The camera rounds once more, about numbers that no
    rounding has made regular.
    """

    def compute(gains: NDArray[np.float64], room_light: NDArray[np.float64]) -> BallsStageResult:
        folder = shutil.copytree(small_project.session.folder, tmp_path / "session")
        random = np.random.default_rng(0)
        paths = sorted((folder / "balls").iterdir())
        for path, gain, offset in zip(paths, gains, room_light, strict=True):
            light = cv2.imread(str(path)).astype(np.float64)
            changed = light * gain[..., ::-1] + offset + random.uniform(-0.5, 0.5, light.shape)
            changed = np.where(light < 255.0, changed, light)
            cv2.imwrite(str(path), np.clip(np.rint(changed), 0.0, 255.0).astype(np.uint8))
        return run_stage(FULL, BALLS, read_session(folder), small_project.results)[BALLS]

    return compute


def unchanged(balls: BallsStageResult) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    return np.ones((len(balls.seen), 3)), np.zeros(len(balls.seen))


def found_gains(balls: BallsStageResult) -> NDArray[np.float64]:
    lights = [ball.light.gain for ball in balls.seen]
    return np.array([np.ones(3) if gain is None else gain.share for gain in lights])


def light_finding(balls: BallsStageResult):
    return next(f for f in balls.background if f.key == "background_light_percent")


def test_a_press_in_the_light_of_the_background_is_not_changed(small_project):
    balls, background = small_project.results[BALLS], small_project.results[BACKGROUND]
    session = small_project.session
    for ball in balls.seen:
        assert ball.light.gain is None
        rgb = session.image(session.folder / "balls" / ball.file).rgb
        np.testing.assert_array_equal(
            ball.image, background.table.apply(background.bad.fill_bad_pixels(rgb))
        )
    assert light_finding(balls).verdict is Verdict.PASS


@pytest.mark.function("Calibrate while the LEDs warm up")
def test_leds_that_warm_up_are_corrected_press_by_press(small_project, balls_in_light):
    before = small_project.results[BALLS]
    gains, dark = unchanged(before)
    gains += np.linspace(0.0, 1.0, len(gains))[:, None] * [0.08, 0.05, 0.03]
    balls = balls_in_light(gains, dark)

    assert found_gains(balls) == pytest.approx(gains, abs=0.003)
    found = light_finding(balls)
    assert found.verdict is Verdict.WARN
    assert found.value == pytest.approx(8.0, abs=0.3)
    assert balls.seen[-1].file in found.remedy
    for ball, other in zip(balls.seen, before.seen, strict=True):
        assert ball.press.pose.depth_mm == pytest.approx(other.press.pose.depth_mm, rel=0.03)
        offset_mm = np.subtract(ball.press.pose.centre_mm, other.press.pose.centre_mm)
        assert np.hypot(*offset_mm) < 0.05


def test_light_that_flickers_by_row_is_corrected_press_by_press(small_project, balls_in_light):
    gains, room_light = unchanged(small_project.results[BALLS])
    row = np.linspace(0.0, 1.0, small_project.results[BACKGROUND].bad.height)
    phase = np.arange(len(gains))[:, None]
    flickers = 1.0 + 0.03 * np.sin(17.0 * row + phase)
    balls = balls_in_light(flickers[..., None, None], room_light)
    assert all("rows" in ball.light.corrected for ball in balls.seen)
    assert not any(ball.light.uncorrected for ball in balls.seen)
    assert "from row to row" in light_finding(balls).remedy
    assert light_finding(balls).verdict is Verdict.WARN


def test_one_press_in_other_light_is_corrected(small_project, balls_in_light):
    gains, dark = unchanged(small_project.results[BALLS])
    gains[1] = 0.9
    balls = balls_in_light(gains, dark)

    assert found_gains(balls) == pytest.approx(gains, abs=0.003)
    assert light_finding(balls).verdict is Verdict.WARN


def test_room_light_in_one_press_is_named_with_its_file(small_project, balls_in_light):
    gains, room_light = unchanged(small_project.results[BALLS])
    room_light[3] = 2.0
    balls = balls_in_light(gains, room_light)

    found = light_finding(balls)
    assert found.verdict is Verdict.FAIL
    assert found.remedy.startswith("Room light")
    assert balls.seen[3].file in found.remedy


def test_room_light_that_hides_a_ball_is_the_reason_to_leave_it_out(small_project, balls_in_light):
    gains, room_light = unchanged(small_project.results[BALLS])
    room_light[1] = 6.0
    balls = balls_in_light(gains, room_light)

    assert balls.seen[1].press is None
    assert balls.seen[1].fault.found.startswith("Room light")
    assert light_finding(balls).verdict is Verdict.PASS


def test_saturated_pixels_stay_saturated():
    image = np.full((2, 2, 3), 0.54, np.float32)
    image[0, 0] = 1.0
    light = undo_light_change(image, LightGain(np.full(3, 1.08), np.zeros(3)))
    assert light[1, 1] == pytest.approx(0.5)
    assert light[0, 0] == pytest.approx(1.0)


def test_light_that_was_corrected_explains_no_failure():
    corrected = judge("background_light_percent", "", 8.0, "%", warn=0.4, remedy="Let them warm up")
    alone = {"balls": QualityTable((corrected,))}
    assert best_cause(alone).key == corrected.key
    failed = judge("ball_height_error_percent", "", 9.0, "%", warn=2.0, fail=4.0)
    assert best_cause({**alone, "joint": QualityTable((failed,))}) is None
