"""What is changed in the set-up is not lost where it is left by another way than its button."""

from __future__ import annotations

import logging
from collections.abc import Callable

import pytest
from technician import Technician

from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.session.session import read_session

Made = Callable[[], CalibrationProject]


def test_what_was_changed_is_taken_as_the_step_is_left_and_can_be_undone(
    technician: Technician, computed_project: Made
) -> None:
    technician.begin(computed_project(), "setup")
    wizard = technician.wizard
    before = read_session(technician.session).sensor.led_height_mm
    wizard.setup.led_height.setValue(before + 0.5)
    technician.click("calibrate.next")
    assert wizard.step.key == "lens"
    assert read_session(technician.session).sensor.led_height_mm == before + 0.5
    assert wizard.controller.undo.count() == 1
    wizard.controller.undo.undo()
    assert read_session(technician.session).sensor.led_height_mm == before
    wizard.go_to("setup")
    wizard.go_to("balls")
    assert not wizard.controller.undo.canUndo()
    wizard.controller.jobs.cancel()
    technician.rest()


def test_what_was_changed_is_taken_as_the_session_is_left(
    technician: Technician, computed_project: Made
) -> None:
    technician.begin(computed_project(), "setup")
    folder, form = technician.session, technician.wizard.setup
    form.led_height.setValue(form.led_height.value() + 0.5)
    stated = form.led_height.value()
    technician.page.begin()
    assert technician.page.wizard is None
    assert read_session(folder).sensor.led_height_mm == stated


def test_a_set_up_that_cannot_be_taken_is_told(
    technician: Technician, computed_project: Made, caplog: pytest.LogCaptureFixture
) -> None:
    technician.begin(computed_project(), "setup")
    technician.wizard.setup.serial.clear()
    with caplog.at_level(logging.INFO):
        technician.wizard.go_to("lens")
    assert "no serial number" in caplog.text
    assert technician.wizard.controller.undo.count() == 0
