"""Unapplied changes in the set-up form are kept, with a warning."""

from dataclasses import replace

import pytest

from app.calibrate import setup_step
from app.calibrate.setup_values import new_session, session_of, values_of
from app.widgets.forms import Form
from gelpolight_core.calibration.recipes import recipe_of
from gelpolight_core.geometry.membrane_shape import FLAT, MembraneShape
from gelpolight_core.session.session import read_session


@pytest.mark.function("Be warned of set-up changes that were not applied")
def test_unapplied_changes_stay_with_a_warning_when_the_step_is_left(
    technician, computed_project, caplog
):
    technician.begin(computed_project(), "setup")
    wizard = technician.wizard
    before = read_session(technician.session).sensor.led_height_mm
    wizard.go_to("lens")
    assert "set-up" not in caplog.text
    wizard.go_to("setup")
    wizard.at("setup").form.values.inputs["led_height_mm"].setValue(before + 0.5)
    wizard.go_to("lens")
    assert "set-up changes are not applied yet" in caplog.text
    assert read_session(technician.session).sensor.led_height_mm == before
    wizard.go_to("setup")
    assert wizard.at("setup").form.values.inputs["led_height_mm"].value() == before + 0.5
    wizard.at("setup").form.accept.click()
    assert read_session(technician.session).sensor.led_height_mm == before + 0.5
    assert not wizard.at("setup").form.edited
    assert technician.state("setup") != "pass" or not wizard.panel.caption.text()
    wizard.model.jobs.cancel()
    technician.rest()
    # Also when the session is closed.
    folder, before = technician.session, technician.kept
    wizard.at("setup").form.values.inputs["led_height_mm"].setValue(before.sensor.led_height_mm + 1)
    technician.page.begin()
    assert technician.page.wizard is None
    assert "set-up changes were not applied" in caplog.text
    assert read_session(folder) == before


def test_values_are_offered_to_be_applied_only_when_changed_and_a_warning_is_shown_once(
    technician, context, computed_project
):
    technician.begin(computed_project(), "setup")
    step, model = technician.wizard.at("setup"), technician.wizard.model
    form = step.form
    assert not form.accept.isEnabled() and not form.accept.property("primary")
    assert technician.wizard.panel.next.property("primary") == model.page.finished
    form.values.inputs["ball_mm"].setValue(2.0 * step.session.sensor.working_diameter_mm)
    assert form.accept.isEnabled() and form.accept.property("primary")
    assert not technician.wizard.panel.next.property("primary")
    form.serial.setText("A-009")
    technician.click("setup.accept")
    assert not form.accept.isEnabled()
    (unusual,) = setup_step.unusual_numbers(step.session)
    assert unusual.sentence in form.problem.text()
    assert unusual.sentence not in model.page.sentence
    model.jobs.cancel()
    technician.rest()
    context.source.choose_virtual_sensor()
    assert context.source.virtual.design.serial in form.camera.text()
    assert "A-009" in form.camera.text(), "it is the camera of another sensor"
    assert form.camera.property("meaning") == "warn"


def test_a_new_form_is_no_mistake_before_something_is_typed(technician):
    technician.page.begin()
    technician.click("question.open")
    form = technician.page.form
    assert form.problem.text() and form.problem.property("meaning") == "muted"
    assert not form.accept.isEnabled()
    form.values.inputs["led_height_mm"].setValue(20.0)
    assert form.problem.property("meaning") == "fail"
    form.serial.setText("B-003")
    assert form.accept.isEnabled() and form.accept.property("primary")


@pytest.mark.function("Enter the sensor's data, and find them again after a restart")
def test_data_typed_for_a_new_sensor_stays_after_restart(technician):
    page = technician.page
    page.begin()
    technician.click("question.open")
    page.form.serial.setText("B-002")
    page.begin()
    technician.click("question.open")
    assert page.form.serial.text() == "B-002"


def test_the_half_angle_of_the_leds_can_be_stated_or_left_out(qtbot):
    new = new_session()
    assert new.sensor.led_half_angle_deg is None
    assert session_of(new, values_of(new)) == new
    stated = session_of(new, replace(values_of(new), led_half_angle_deg=62.5))
    assert stated.sensor.led_half_angle_deg == 62.5
    assert session_of(stated, values_of(stated)) == stated
    form = Form(values_of(stated), "setup")
    qtbot.addWidget(form)
    form.inputs["led_half_angle_deg"].stepBy(-10000)
    assert session_of(stated, form.value) == new


def test_the_height_of_a_dome_is_asked_and_0_is_a_flat_membrane():
    values = replace(values_of(new_session()), working_diameter_mm=24.0)
    assert values.apex_height_mm == 0.0
    flat = session_of(new_session(), values)
    assert flat.surface == FLAT
    dome = session_of(flat, replace(values, apex_height_mm=1.5))
    assert dome.surface == MembraneShape("spherical_cap", 1.5, 24.0)
    assert values_of(dome).apex_height_mm == 1.5
    closed = session_of(new_session(optics=False), replace(values, optics=False))
    assert closed.surface == FLAT
    closed = session_of(closed, replace(values_of(closed), apex_height_mm=0.5))
    assert closed.surface == MembraneShape("spherical_cap", 0.5, 26.0)
    assert session_of(closed, values_of(closed)) == closed
    keys = [stage.key for stage in recipe_of(flat).of(flat)]
    assert [stage.key for stage in recipe_of(dome).of(dome)] == [k for k in keys if k != "radiance"]
