"""The session keeps how its camera was set, and the camera is held to it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from fake_camera import C310, FakeCamera, FakeDriver
from PySide6.QtWidgets import QWidget
from pytestqt.qtbot import QtBot
from technician import Technician

from app.bench.stated import stated_session
from app.shell.context import AppContext
from app.widgets.source_button import SourceButton
from gelpolight_core.calibration.inputs import Stage
from gelpolight_core.calibration.pipeline import _provenance
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.session.camera_settings import settings_of_texts
from gelpolight_core.session.description import create_session
from gelpolight_core.session.session import read_session

WAIT_MS = 60_000
TEXTS = {"name": "C310", "identity": "x", "control.gain": "3"}
Made = Callable[[], CalibrationProject]


@pytest.fixture
def fresh(small_session: Path, tmp_path: Path) -> CalibrationProject:
    folder = tmp_path / "fresh"
    create_session(replace(read_session(small_session), folder=folder))
    return CalibrationProject(folder)


@pytest.fixture
def fake(context: AppContext) -> FakeCamera:
    fake = FakeCamera()
    context.cameras.driver = FakeDriver(fake)
    context.source.choose(context.cameras.infos()[0])
    return fake


def live(context: AppContext, qtbot: QtBot) -> None:
    camera = context.cameras.of(context.source.info)
    assert camera is not None
    qtbot.waitUntil(lambda: camera.state.phase == "live" and not camera.settling, timeout=WAIT_MS)


def test_settings_are_kept_with_the_pictures_and_held_to_from_then_on(
    technician: Technician,
    context: AppContext,
    fake: FakeCamera,
    fresh: CalibrationProject,
    qtbot: QtBot,
    caplog: pytest.LogCaptureFixture,
) -> None:
    context.toasts.attach(technician.page, lambda: None)
    technician.begin(fresh, "balls")
    live(context, qtbot)
    camera = context.cameras.of(context.source.info)
    assert camera is not None
    context.cameras.lock(camera)
    live(context, qtbot)
    technician.capture()
    technician.rest()
    kept = read_session(fresh.session.folder).camera_settings
    assert kept is not None
    assert (kept.identity, kept.pixel_format, kept.size) == (C310.identity, "YUYV", (128, 96))
    assert kept.controls["exposure_auto"] == 0.0

    context.cameras.set(camera, {"exposure_ms": 12.0})
    words = "not set as it was for the pictures of this session: Exposure is 12 ms, not 33.3 ms"
    qtbot.waitUntil(lambda: words in caplog.text, timeout=WAIT_MS)
    technician.capture()
    technician.rest()
    assert read_session(fresh.session.folder).camera_settings == kept

    fake.forgets = True  # as after a night without power
    technician.page.leave()
    fake.opened = 0
    context.cameras.restore(camera)
    technician.page.enter()
    qtbot.waitUntil(lambda: fake.opened == 1, timeout=WAIT_MS)
    live(context, qtbot)
    assert fake.settings["exposure_ms"].value == 33.3
    assert fake.settings["exposure_auto"].value == 0.0
    context.toasts.clear()


def test_the_mirror_may_have_an_exposure_of_its_own(
    technician: Technician, context: AppContext, fake: FakeCamera, fresh: CalibrationProject,
    qtbot: QtBot,
) -> None:  # fmt: skip
    """What is kept is how the camera was set for the white board, with which all is compared."""
    context.toasts.attach(technician.page, lambda: None)
    technician.begin(fresh, "lights")
    live(context, qtbot)
    camera = context.cameras.of(context.source.info)
    assert camera is not None
    context.cameras.lock(camera)
    qtbot.waitUntil(lambda: fake.settings["exposure_auto"].value == 0.0, timeout=WAIT_MS)
    for step, exposure_ms in (("lights", 2.0), ("radiance", 12.0), ("background", 12.0)):
        technician.wizard.go_to(step)
        live(context, qtbot)
        context.cameras.set(camera, {"exposure_ms": exposure_ms})
        qtbot.waitUntil(
            lambda wanted=exposure_ms: camera.settings_now().controls["exposure_ms"] == wanted,
            timeout=WAIT_MS,
        )
        live(context, qtbot)
        technician.capture()
        technician.rest()
    kept = read_session(fresh.session.folder).camera_settings
    assert kept is not None
    assert kept.controls["exposure_ms"] == 12.0
    assert not context.cameras.differs(camera)[1]
    context.toasts.clear()


def test_imported_pictures_say_nothing_of_the_camera_that_is_live(
    technician: Technician, context: AppContext, fake: FakeCamera, fresh: CalibrationProject,
    small_session: Path, qtbot: QtBot,
) -> None:  # fmt: skip
    technician.begin(fresh, "balls")
    live(context, qtbot)
    technician.wizard.taking.import_files([small_session / "balls" / "ball_01.png"])
    technician.rest()
    assert fresh.session.captured("balls")
    assert read_session(fresh.session.folder).camera_settings is None


def test_a_calibration_is_told_how_its_camera_was_set(computed_project: Made) -> None:
    project, stored = computed_project(), settings_of_texts(TEXTS)
    before = {stage: status.state for stage, status in project.statuses().items()}
    project.set_camera(stored)
    assert {stage: status.state for stage, status in project.statuses().items()} == before
    assert settings_of_texts(_provenance(project.session).camera_settings) == stored


def test_stating_the_sensor_anew_keeps_the_camera(fresh: CalibrationProject) -> None:
    stored = settings_of_texts(TEXTS)
    fresh.set_camera(stored)
    sensor = replace(fresh.session.sensor, led_height_mm=13.0)
    fresh.describe(replace(fresh.session, sensor=sensor, camera_settings=None))
    assert fresh.session.camera_settings == stored
    assert fresh.statuses()[Stage.LENS].state.value == "empty"


def test_the_set_up_step_says_how_the_camera_is_and_opens_its_settings(
    technician: Technician,
    context: AppContext,
    fake: FakeCamera,
    fresh: CalibrationProject,
    qtbot: QtBot,
) -> None:
    technician.begin(fresh, "setup")
    setup = technician.wizard.setup
    assert "set and lock it before the first picture" in setup.camera.text()
    setup.camera_settings.click()
    dialog = technician.page.findChild(QWidget, "camera")
    live(context, qtbot)
    qtbot.waitUntil(lambda: "not locked" in setup.camera.text(), timeout=WAIT_MS)
    dialog.close()
    context.source.choose(None)
    assert "No camera is chosen" in setup.camera.text()
    assert not setup.camera_settings.isEnabled()


def test_the_camera_of_a_new_sensor_is_chosen_in_the_form(
    technician: Technician, context: AppContext, qtbot: QtBot
) -> None:
    context.cameras.driver = FakeDriver(FakeCamera())
    technician.page.begin()
    form = technician.page.form
    button = technician.see("setup.source")
    assert isinstance(button, SourceButton)
    assert not form.camera_settings.isEnabled()
    button.use_camera(context.cameras.infos()[0])
    assert C310.name in form.camera.text()
    assert form.camera_settings.isEnabled()
    assert form.stated().sensor.serial == ""

    context.source.choose_virtual_sensor()
    assert form.stated().sensor == stated_session().sensor
    context.source.choose(None)
