"""What is changed in the set-up and not taken is neither lost nor left in silence."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from technician import Technician

from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.session.session import read_session

Made = Callable[[], CalibrationProject]


def test_what_was_changed_stays_and_is_told_as_the_step_is_left(
    technician: Technician, computed_project: Made, caplog: pytest.LogCaptureFixture
) -> None:
    technician.begin(computed_project(), "setup")
    wizard = technician.wizard
    before = read_session(technician.session).sensor.led_height_mm
    wizard.go_to("lens")
    assert "set-up" not in caplog.text
    wizard.go_to("setup")
    wizard.setup.led_height.setValue(before + 0.5)
    wizard.go_to("lens")
    assert "in the set-up is not taken yet" in caplog.text
    assert read_session(technician.session).sensor.led_height_mm == before
    wizard.go_to("setup")
    assert wizard.setup.led_height.value() == before + 0.5
    wizard.setup.accept.click()
    assert read_session(technician.session).sensor.led_height_mm == before + 0.5
    assert not wizard.setup.edited
    wizard.controller.jobs.cancel()
    technician.rest()


def test_what_was_changed_is_told_as_the_session_is_left(
    technician: Technician, computed_project: Made, caplog: pytest.LogCaptureFixture
) -> None:
    technician.begin(computed_project(), "setup")
    folder, form = technician.session, technician.wizard.setup
    before = read_session(folder)
    form.led_height.setValue(form.led_height.value() + 0.5)
    technician.page.begin()
    assert technician.page.wizard is None
    assert "in the set-up was not taken" in caplog.text
    assert read_session(folder) == before


def test_what_was_typed_of_a_new_sensor_stays_when_it_is_begun_again(
    technician: Technician,
) -> None:
    page = technician.page
    page.begin()
    page.form.serial.setText("B-002")
    page.begin()
    assert page.form.serial.text() == "B-002"
