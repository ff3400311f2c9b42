"""A calibration does not depend on how many threads share its work."""

from __future__ import annotations

from dataclasses import replace

import pytest

from gelpolight_core import parallel
from gelpolight_core.calibration.inputs import Stage
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.calibration.stages import run_stage


@pytest.mark.parametrize("threads", [1, 3])
def test_boards_and_balls_are_found_alike_by_any_number_of_threads(
    small_project: CalibrationProject, monkeypatch: pytest.MonkeyPatch, threads: int
) -> None:
    session, before = small_project.session, small_project._results
    monkeypatch.setattr(parallel, "usable_cores", lambda: threads)
    again = run_stage(Stage.LENS, session, before)
    again = run_stage(Stage.BALLS, session, replace(again, balls=()))
    assert before.lens is not None and again.lens is not None
    assert again.lens.camera == before.lens.camera
    assert [press.pose for press in again.presses] == [press.pose for press in before.presses]
    assert [ball.file for ball in again.balls] == [ball.file for ball in before.balls]
