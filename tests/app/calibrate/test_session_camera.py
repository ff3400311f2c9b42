"""A session stores its camera settings, and the camera is kept at them."""

from dataclasses import replace

import pytest
from fake_camera import C310, FakeCamera, FakeDriver
from technician import Technician

from app.source_ui.source_button import SourceButton
from app.source_ui.virtual_session import virtual_session
from app.sources.camera_drivers.shared_camera import SharedCamera
from gelpolight_core.calibration.project import CalibrationProject


@pytest.fixture
def fake(context):
    fake = FakeCamera()
    context.cameras.driver = FakeDriver(fake)
    context.source.choose(context.cameras.infos()[0])
    return fake


@pytest.fixture
def camera(context, technician, fake):
    """Return the camera that is the source, with messages shown on the page."""
    context.toasts.attach(technician.page, lambda: None)
    camera = context.cameras.of(context.source.info)
    yield camera
    context.toasts.clear()


def live(technician: Technician, camera: SharedCamera) -> None:
    technician.until(lambda: camera.state.phase == "live" and not camera.settling)


def begin(
    technician: Technician, camera: SharedCamera, fresh: CalibrationProject, step: str
) -> None:
    technician.begin(fresh, step)
    live(technician, camera)


def capture(technician: Technician) -> None:
    technician.capture()
    technician.rest()


@pytest.mark.function("Store the camera's settings with the session, and be told when they differ")
def test_settings_are_stored_with_the_images_and_monitored(
    technician, context, fake, camera, fresh, caplog
):
    begin(technician, camera, fresh, "balls")
    camera.lock()
    live(technician, camera)
    capture(technician)
    kept = technician.kept.camera_settings
    assert (kept.identity, kept.pixel_format, kept.size) == (C310.identity, "YUYV", (128, 96))
    assert kept.controls["exposure_auto"] == 0.0
    context.cameras.set(camera, {"exposure_ms": 12.0})
    words = "differ from those for the images of this session: Exposure is 12 ms, not 33.3 ms"
    technician.until(lambda: words in caplog.text)
    capture(technician)
    assert technician.kept.camera_settings == kept
    fake.forgets = True  # as after a power cut
    technician.page.leave()
    fake.opened = 0
    context.cameras.restore_reference(camera)
    technician.page.enter()
    technician.until(lambda: fake.opened == 1)
    live(technician, camera)
    assert fake.settings["exposure_ms"].value == 33.3
    assert fake.settings["exposure_auto"].value == 0.0


def test_the_mirror_may_have_its_own_exposure(technician, context, fake, camera, fresh):
    """The reference is the whiteboard image, with which all others are compared."""
    begin(technician, camera, fresh, "lights")
    camera.lock()
    technician.until(lambda: fake.settings["exposure_auto"].value == 0.0)
    for step, exposure_ms in (("lights", 2.0), ("radiance", 12.0), ("background", 12.0)):
        technician.wizard.go_to(step)
        live(technician, camera)
        context.cameras.set(camera, {"exposure_ms": exposure_ms})
        technician.until(
            lambda wanted=exposure_ms: camera.settings_now().controls["exposure_ms"] == wanted
        )
        live(technician, camera)
        capture(technician)
    kept = technician.kept.camera_settings
    assert kept.controls["exposure_ms"] == 12.0
    assert not context.cameras.differs(camera)[1]


def test_the_camera_of_another_sensor_is_rejected(technician, camera, fresh):
    """The same model but another camera: it belongs to another sensor."""
    begin(technician, camera, fresh, "balls")
    capture(technician)
    (first,) = fresh.session.captured("balls")
    kept = fresh.session.camera_settings
    fresh.set_camera(replace(kept, identity="046d:081b@SN2"))
    technician.wizard.panel.capture.click()
    technician.rest()
    assert fresh.session.captured("balls") == (first,)
    shown = technician.wizard.panel.notice.text()
    assert "046d:081b@SN2" in shown and C310.identity in shown
    technician.click("question.answer0")  # it is the same, at another port
    capture(technician)
    assert len(fresh.session.captured("balls")) == 2


def test_the_camera_of_a_new_sensor_is_selected_in_the_form(technician, context, qtbot):
    context.cameras.driver = FakeDriver(FakeCamera())
    technician.page.begin()
    technician.click("question.open")
    form = technician.page.form
    button = SourceButton(context=context)
    qtbot.addWidget(button)
    assert not form.camera_settings.isEnabled()
    button.use_camera(context.cameras.infos()[0])
    assert C310.name in form.camera.text()
    assert form.camera_settings.isEnabled()
    assert form.stated().sensor.serial == ""

    context.source.choose_virtual_sensor()
    assert form.stated().sensor == virtual_session().sensor
    context.source.choose(None)


def test_a_recording_of_another_sensor_is_rejected(
    technician, context, computed_project, monkeypatch
):
    technician.begin(computed_project(), "background")
    wizard = technician.wizard
    for serial, refused in (("virtual-1", False), ("", False), ("A-002", True)):
        monkeypatch.setattr(type(wizard.live), "serial", property(lambda _, s=serial: s))
        assert ("A-002" in wizard.model.camera.fault()) is refused
    technician.rest()
