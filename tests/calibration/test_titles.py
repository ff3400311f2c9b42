"""A stage is called the same wherever a person reads of it."""

from __future__ import annotations

import scene

from gelpolight_core.calibration.titles import TITLES, stage_title


def test_every_stage_of_a_calibration_has_a_title() -> None:
    for stage in scene.calibration().quality:
        assert stage in TITLES


def test_a_stage_of_a_later_program_goes_by_its_key() -> None:
    assert stage_title("magnetism") == "magnetism"
