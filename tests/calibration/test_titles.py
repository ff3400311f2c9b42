"""Names of the calibration stages."""

from __future__ import annotations

import scene

from gelpolight_core.calibration.titles import stage_title


def test_every_stage_of_a_calibration_has_a_title() -> None:
    for stage in scene.calibration().quality:
        assert stage_title(stage) != stage


def test_an_unknown_stage_is_shown_by_its_key() -> None:
    assert stage_title("magnetism") == "magnetism"
