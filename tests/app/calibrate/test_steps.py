"""The steps of the wizard."""

from __future__ import annotations

from app.calibrate.steps import all_steps
from gelpolight_core.calibration.titles import TITLES, stage_title


def test_a_stage_is_called_what_reports_and_the_library_call_it() -> None:
    titles = {step.key: step.title for step in all_steps() if step.key in TITLES}
    assert len(titles) >= 5
    for key, title in titles.items():
        assert title == stage_title(key)
