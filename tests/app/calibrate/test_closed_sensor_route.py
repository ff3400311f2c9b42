"""The route of a closed sensor, from the first question to a validated calibration."""

import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from app.calibrate.closed_sensor_steps import InPlaceProgress
from app.calibrate.detection_marks import as_image, read_raw
from app.calibrate.result_step import write_session_report
from app.calibrate.setup_step import SetupForm
from app.calibrate.setup_values import new_session
from gelpolight_core.calibration import closed_sensor_recipe
from gelpolight_core.calibration.calibration_file import read_calibration
from gelpolight_core.calibration.closed_sensor.preset import preset_named
from gelpolight_core.calibration.closed_sensor_stages import SETTLED
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.session.description import create_session
from gelpolight_core.session.reference_object import ReferenceObject
from gelpolight_core.session.session import ClosedSensorSettings, SensorData, read_session
from gelpolight_core.simulation.sensor_design import SensorDesign

MM_PER_PX = 0.0989
SCALE = ClosedSensorSettings((MM_PER_PX, MM_PER_PX))
"""Apparent distance of the design's membrane over its focal length, at a quarter of its size."""


@pytest.mark.function("Calibrate a sensor that cannot be opened, in the wizard")
def test_from_the_first_question_to_a_validated_calibration(
    technician, small_session_of_ten_balls, tmp_path, qtbot
):
    page, opened = technician.page, read_session(small_session_of_ten_balls)
    page.begin()
    technician.click("question.closed")
    form = page.form
    qtbot.keyClicks(form.serial, "closed-1")
    form.values.inputs["scale"].setValue(MM_PER_PX)
    technician.click("setup.accept")
    wizard = technician.wizard
    assert [one.key for one in wizard.steps] == [
        "setup", "background", "balls", "result", "validation",
    ]  # fmt: skip
    assert wizard.open.key == "background"
    wizard.open.import_files([*opened.files("background")])
    technician.rest()
    assert technician.state("background") in ("pass", "warn")
    technician.click("calibrate.next")

    files = opened.files("balls")[:7]
    nothing = tmp_path / "nothing.png"
    nothing.write_bytes(opened.files("background")[0].read_bytes() + b"\0")
    by_radius: dict[float, list[Path]] = {}
    for path in files[:-1]:
        by_radius.setdefault(opened.ball_radius_mm(path.name), []).append(path)
    for number, (radius_mm, paths) in enumerate(by_radius.items()):
        technician.wizard.at("balls").radius.setValue(2.0 * radius_mm)
        wizard.open.import_files([*paths, *([nothing] if number == 0 else [])])
        technician.until(lambda: not wizard.model.busy_with_images)
    technician.rest()
    assert technician.state("balls") in ("pass", "warn")
    progress = wizard.open.progress
    assert progress.error_deg < 4.0
    assert wizard.panel.number.text() == f"{progress.error_deg:.3g}\N{DEGREE SIGN}"
    captures = wizard.open.captures()
    (refused,) = [capture for capture in captures if capture.state == "fail"]
    assert refused.finding.sentence, "an image that shows no ball keeps its reason"
    assert sum(capture.residual < 180.0 for capture in captures) == len(files) - 1
    assert wizard.model.page.finished is progress.settled

    wizard.go_to("result")
    technician.click("result.save")
    technician.rest()
    (path,) = (tmp_path / "workspace" / "sensors").rglob("*.gplcal")
    assert read_calibration(path).model == "in-place"
    step = wizard.at("validation")
    report = tmp_path / "report.pdf"
    write_session_report(report, step)
    technician.rest()
    assert report.is_file()
    wizard.go_to("validation")
    step.show_known(ReferenceObject("ball", 2.0 * opened.ball_radius_mm(files[-1].name)))
    step.import_press(files[-1])
    technician.until(step.keep.isEnabled)
    technician.click("validation.keep")
    assert technician.state("validation") == "pass"


@pytest.mark.function("Move the contact of a ball on a closed sensor, and undo it")
def test_a_contact_is_moved_by_hand_and_undo_returns_to_the_found_one(
    technician, small_session, tmp_path
):
    project = closed_project(small_session, tmp_path, balls=2)
    technician.begin(project, "balls")
    wizard = technician.wizard
    name = project.session.found("balls")[-1].name
    assert wizard.model.page.shown == name, "without a camera the session shows its own images"
    contact = wizard.area.view.image.overlay
    technician.until(lambda: contact.handles)
    (found,) = contact.handles
    u, v = found.at
    wizard.open.moved("ball", u + 3.0, v, found.radius)
    technician.until(lambda: contact.handles and contact.handles[0].at[0] == u + 3.0)
    assert project.session.decisions.balls[name].u_px == u + 3.0
    technician.rest()
    wizard.model.undo.undo()
    technician.until(lambda: contact.handles and contact.handles[0].at[0] == u)
    technician.rest()
    assert not project.session.decisions.balls


@pytest.mark.function("Correct a wrong diameter of a closed sensor's ball with a button")
def test_a_wrong_diameter_is_amber_and_a_button_corrects_it(
    technician, small_session_of_ten_balls, tmp_path
):
    project = closed_project(small_session_of_ten_balls, tmp_path, balls=10)
    name = project.session.found("balls")[0].name
    project.set_ball_radius(name, 4.0)
    technician.begin(project, "balls")
    assert technician.state("balls") == "warn"
    captures = technician.wizard.model.page.captures
    assert [c.path.name for c in captures if c.state == "warn"] == [name]
    assert "6 mm" in technician.see("calibrate.remedy0").text()
    technician.click("calibrate.remedy0")
    technician.rest()
    assert project.session.ball_radius_mm(name) == 3.0
    assert all(capture.state == "pass" for capture in technician.wizard.model.page.captures)


@pytest.mark.function("See the images of a session while another sensor is the source")
def test_the_images_of_another_sensor_are_not_shown_in_the_session(
    technician, small_session, tmp_path
):
    """The virtual sensor may be the source when a session is opened from files."""
    technician.page.context.source.choose_virtual_sensor()
    project = closed_project(small_session, tmp_path, balls=1)
    technician.begin(project, "background")
    assert technician.state("balls") == "begun", "too few presses are not a failure"
    technician.until(lambda: technician.wizard.model.page.shown)
    technician.wizard.go_to("balls")
    assert technician.wizard.model.page.shown == project.session.found("balls")[0].name
    technician.wizard.open.live()
    technician.until(lambda: technician.see("calibrate.capture").isEnabled())
    technician.click("calibrate.capture")
    assert "belongs to sensor c" in technician.see("calibrate.notice").text()
    # Also beside a sensor of its serial the session shows its own images.
    project.describe(replace(project.session, sensor=SensorData(SensorDesign().serial)))
    technician.begin(project, "balls")
    assert not technician.wizard.model.camera.fault()
    assert technician.wizard.model.page.shown == project.session.found("balls")[0].name


@pytest.mark.function("Capture or import images of a pressed pin grid and see the scale")
def test_the_scale_is_measured_on_a_pressed_pin_grid(technician, small_session, tmp_path):
    project = closed_project(small_session, tmp_path, balls=4)
    technician.begin(project, "balls")
    technician.wizard.go_to("setup")
    inputs, first = technician.wizard.open.form.values.inputs, technician.wizard
    inputs["scale_from"].setCurrentIndex(inputs["scale_from"].findData("pins"))
    inputs["pins"].setValue(3.0)
    technician.click("setup.accept")
    technician.until(lambda: technician.wizard is not first)
    technician.rest()
    assert technician.state("scale") == "empty"
    assert project.stale() == ()

    technician.wizard.go_to("scale")
    background = as_image(read_raw(project.session.found("background")[-1])).rgb
    technician.wizard.open.import_files([with_pins(background, tmp_path / "pins.png")])
    technician.rest()
    technician.until(lambda: technician.state("scale") == "begun")  # one image of three
    measured = project.results[closed_sensor_recipe.SCALE]
    assert measured.mm_per_px == pytest.approx([3.0 / PINS_PX] * 2, rel=0.01)
    name = project.session.found("scale")[0].name
    technician.wizard.show_capture(name)
    said = technician.wizard.panel.live
    technician.until(lambda: f"{measured.pins} pins" in said.text())
    assert "balls" in project.stale()
    technician.wizard.model.undo.undo()
    technician.rest()
    assert technician.state("scale") == "empty"

    technician.wizard.go_to("setup")
    inputs, second = technician.wizard.open.form.values.inputs, technician.wizard
    inputs["scale_from"].setCurrentIndex(inputs["scale_from"].findData("stated"))
    technician.click("setup.accept")
    technician.until(lambda: technician.wizard is not second)
    technician.rest()
    assert "scale" not in [one.key for one in technician.wizard.steps]


PINS_PX = 16.0


def with_pins(rgb: NDArray[np.float32], path: Path) -> Path:
    """Write an image with a pressed grid of pins, PINS_PX apart."""
    rows, columns = rgb.shape[:2]
    v, u = np.mgrid[:rows, :columns] - 0.5 * np.array([rows, columns])[:, None, None]
    away = [np.mod(at, PINS_PX) - 0.5 * PINS_PX for at in (u, v)]
    inside = np.hypot(u, v) < 3.6 * PINS_PX
    pins = np.where(inside, np.exp(-(away[0] ** 2 + away[1] ** 2) / (2.0 * 2.0**2)), 0.0)
    raw = np.clip(255.0 * (rgb + 0.15 * pins[..., None]), 0.0, 255.0).astype(np.uint8)
    cv2.imwrite(str(path), raw[..., ::-1])
    return path


def closed_project(opened: Path, tmp_path: Path, *, balls: int) -> CalibrationProject:
    """Return a session with the background and some presses of the small sensor."""
    source = read_session(opened)
    session = replace(
        new_session(optics=False),
        folder=tmp_path / "session",
        sensor=SensorData("c"),
        in_place=SCALE,
    )
    create_session(session)
    project = CalibrationProject(session.folder)
    project.import_files("background", source.files("background"))
    for path in source.files("balls")[:balls]:
        radius_mm = source.ball_radius_mm(path.name)
        project.import_files("balls", [path], radius_mm=radius_mm)
    return project


@pytest.mark.function("Take scale and region from a preset")
def test_a_preset_fills_in_the_scale_and_its_uncertainty(context, qtbot):
    form = SetupForm(context=context)
    qtbot.addWidget(form)
    form.show_session(new_session(optics=False), new=True)
    digit = preset_named("digit")
    form.values.change(preset="digit")
    stated = form.stated()
    assert stated.in_place.mm_per_px == pytest.approx((digit.mm_per_px, digit.mm_per_px))
    assert stated.in_place.mm_per_px_sd == pytest.approx(digit.mm_per_px_sd, rel=0.02)
    assert str(digit.image_px[0]) in form.facts.text()
    form.show_session(stated, new=False)
    assert form.values.value.preset == "digit"
    assert not form.edited


@pytest.mark.function("Learn when more presses do not help")
@pytest.mark.parametrize(("gain", "asks"), [(None, True), (2.0 * SETTLED, True), (0.0, False)])
def test_it_stops_asking_when_more_presses_do_not_help(gain, asks):
    progress = InPlaceProgress(2.0, gain)
    assert progress.settled is not asks
    assert ("ring" in progress.sentence()) is asks


def test_a_folder_without_the_open_stages_is_offered_the_closed_route(
    technician, small_session, tmp_path
):
    """One message lists everything that is missing; the images are used, not changed."""
    folder, opened = tmp_path / "owner", read_session(small_session)
    shutil.copytree(small_session / "background", folder / "background")
    (folder / "balls").mkdir()
    for path in opened.files("balls")[:2]:
        shutil.copy(path, folder / "balls")
    (folder / "session.toml").write_text(
        'format = "gelpolight-session"\nversion = 1\n[sensor]\nserial = "B-7"\n'
        "[balls]\ndefault = 2.5\n"
    )
    before = sorted(folder.rglob("*"))
    technician.page.open_path(folder)
    problem = technician.see("question.problem").text()
    assert all(stage in problem for stage in ("checkerboard", "top_pose", "mirror", "whiteboard"))
    technician.click("question.use_folder")
    assert technician.page.form.serial.text() == "B-7"
    technician.click("setup.accept")
    technician.rest()
    session = technician.wizard.project.session
    assert [len(session.found(stage)) for stage in ("background", "balls")] == [1, 2]
    assert set(session.ball_radii_mm.values()) == {2.5}
    assert sorted(folder.rglob("*")) == before
