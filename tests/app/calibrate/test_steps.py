"""The steps of the wizard."""

from __future__ import annotations

from app.calibrate.steps import OPEN_ROUTE, steps_of
from gelpolight_core.calibration.titles import stage_title


def test_stages_have_the_same_names_as_in_reports_and_the_library() -> None:
    titles = {
        step.key: step.title for step in steps_of(OPEN_ROUTE) if stage_title(step.key) != step.key
    }
    assert len(titles) >= 5
    for key, title in titles.items():
        assert title == stage_title(key)
