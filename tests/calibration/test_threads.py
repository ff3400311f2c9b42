"""A calibration does not depend on how many threads share its work."""

from gelpolight_core.base import parallel
from gelpolight_core.calibration.open_ball_stages import BALLS, BallsStageResult
from gelpolight_core.calibration.open_sensor_recipe import LENS
from gelpolight_core.calibration.project import run_stage
from gelpolight_core.calibration.recipes import FULL


def test_boards_and_balls_are_found_alike_by_any_number_of_threads(small_project, monkeypatch):
    session, before = small_project.session, small_project._results
    monkeypatch.setattr(parallel, "usable_cores", lambda: 5)
    again = run_stage(FULL, LENS, session, before)
    again = run_stage(FULL, BALLS, session, again.having(BALLS, BallsStageResult(())))
    assert again[LENS].camera == before[LENS].camera
    balls, first = again[BALLS], before[BALLS]
    assert [press.pose for press in balls.presses] == [press.pose for press in first.presses]
    assert [ball.file for ball in balls.seen] == [ball.file for ball in first.seen]
