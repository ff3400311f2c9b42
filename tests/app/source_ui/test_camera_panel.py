"""A technician selects a camera, locks it, and is warned when its settings differ."""

from dataclasses import replace

import pytest
from fake_camera import C310, FakeCamera, FakeDriver
from PySide6.QtCore import Qt
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QComboBox, QDoubleSpinBox, QWidget

from app.program.camera_manager import CameraManager
from app.source_ui.camera_dialog import CameraDialog, show_camera_dialog
from app.source_ui.source_button import SourceButton
from app.sources.camera_drivers.driver import CameraDevice, CameraFormat
from app.sources.camera_drivers.shared_camera import SharedCamera
from app.sources.stream import Stream
from gelpolight_core.session.camera_settings import CameraSettings

WAIT_MS = 60_000


@pytest.fixture
def fake():
    return FakeCamera()


@pytest.fixture
def host(context, fake, qtbot):
    """Return a window that can show messages, with the fake camera plugged in."""
    context.cameras.driver = FakeDriver(fake)
    window = QWidget()
    qtbot.addWidget(window)
    window.resize(900, 700)
    context.toasts.attach(window, lambda: None)
    window.show()
    yield window
    context.toasts.clear()


@pytest.fixture
def panel(context, host, qtbot):
    context.source.choose(context.cameras.infos()[0])
    camera = context.cameras.of(context.source.info)
    shown = show_camera_dialog(context.cameras, camera, host)
    qtbot.waitUntil(lambda: shown.lock.isEnabled(), timeout=WAIT_MS)
    yield shown
    shown.hide()


def values(camera: SharedCamera) -> dict[str, float]:
    return {control.key: control.value for control in camera.state.controls}


@pytest.mark.function("Choose a camera by its name")
def test_cameras_are_selected_by_name_and_none_is_shown_as_text(context, host, fake, qtbot):
    twin = CameraDevice("046d:081b@SN2", C310.name, C310.model, "/dev/video2")
    context.cameras.driver = FakeDriver(fake, FakeCamera(device=twin))
    button = SourceButton(context=context)
    qtbot.addWidget(button)
    button.list_cameras()
    texts = [button.findChild(QAction, f"state.camera.{n}").text() for n in (0, 1)]
    assert texts == [f"{C310.name} (/dev/video0)", f"{C310.name} (/dev/video2)"]
    assert not button.findChild(QAction, "state.camera.settings").isEnabled()
    button.findChild(QAction, "state.camera.1").trigger()
    assert context.source.info.detail == twin.identity
    assert button.findChild(QAction, "state.camera.settings").isEnabled()
    fake.plugged = False
    context.cameras.driver = FakeDriver(fake)
    button.list_cameras()
    (none,) = [
        action for action in button.menu().actions() if action.objectName() == "state.camera.0"
    ]
    assert (none.text(), none.isEnabled()) == ("No camera connected", False)


def test_two_cameras_with_one_serial_number_are_two_cameras(context, host):
    """Also after one of them is unplugged, and after a restart."""
    one, two = (
        FakeCamera(device=replace(C310, identity=f"046d:081b@SN7734/1.0 at 1-{port}"))
        for port in (2, 3)
    )
    cameras, identities = context.cameras, (one.device.identity, two.device.identity)
    cameras.driver = FakeDriver(one)
    assert cameras.is_same(*identities)  # as far as is known: one camera at another port
    assert cameras.is_same("046d:081b@SN7734/1.0", identities[0])  # of an older file
    cameras.driver = FakeDriver(one, two)
    infos = cameras.infos()
    assert [info.name for info in infos] == [f"{C310.name} (1-2)", f"{C310.name} (1-3)"]
    assert cameras.of(infos[0]) is not cameras.of(infos[1])
    cameras.driver = FakeDriver(two)
    cameras.infos()
    again = CameraManager(settings=context.settings, status=context.status, toasts=context.toasts)
    for manager in (cameras, again):
        assert not manager.is_same(*identities)
        assert not manager.is_same("046d:081b@SN7734/1.0", identities[0])
    again.accept_same("046d:081b@SN7734/1.0", identities[0])
    later = CameraManager(settings=context.settings, status=context.status, toasts=context.toasts)
    assert later.is_same("046d:081b@SN7734/1.0", identities[0])
    context.source.choose_again("camera", identities[0], cameras)
    assert context.source.info is None  # only the other one is connected


def test_the_dialog_opens_once_and_releases_the_camera(context, host, fake, qtbot):
    button = SourceButton(context=context, parent=host)
    button.list_cameras()
    button.findChild(QAction, "state.camera.0").trigger()
    button.findChild(QAction, "state.camera.settings").trigger()
    button.show_settings()
    (dialog,) = host.findChildren(CameraDialog)
    qtbot.waitUntil(lambda: dialog.lock.isEnabled(), timeout=WAIT_MS)
    dialog.close()
    qtbot.waitUntil(lambda: fake.closed == 1, timeout=WAIT_MS)
    assert fake.opened == 1


@pytest.mark.function("Lock the automatic settings of a camera")
def test_locking_fixes_the_automatic_settings(context, panel, fake, qtbot):
    assert "still automatic" in panel.state.text()
    assert context.status.value.camera_note == "not locked"
    assert not panel.findChild(QDoubleSpinBox, "camera.exposure_ms").isEnabled()
    qtbot.mouseClick(panel.lock, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: "Locked" in panel.state.text(), timeout=WAIT_MS)
    now = values(panel.camera)
    assert (now["exposure_auto"], now["white_balance_auto"]) == (0.0, 0.0)
    assert now["exposure_ms"] == 33.3  # the value that the camera had chosen automatically
    assert panel.findChild(QDoubleSpinBox, "camera.exposure_ms").isEnabled()
    assert context.status.value.camera_note == ""
    # A rejected value is shown as it is read back.
    fake.ignores = {"gain"}
    gain = panel.findChild(QDoubleSpinBox, "camera.gain")
    gain.setValue(90.0)
    qtbot.waitUntil(lambda: gain.value() == 64.0, timeout=WAIT_MS)
    table = panel.locks.table["gain"]
    assert (table.verdict.value, table.value) == ("fail", 64.0)
    assert "Gain is 64, not 90" in table.remedy


@pytest.mark.function("Choose a camera format, with a warning of compression")
def test_a_listed_format_is_selected_with_a_compression_warning(context, panel, qtbot, caplog):
    code = panel.findChild(QComboBox, "camera.format")
    assert [code.itemText(n) for n in range(code.count())] == [
        "MJPG (compressed)",
        "YUYV (uncompressed)",
    ]
    assert not panel.formats.warning.isVisible()
    code.setCurrentIndex(0)
    code.activated.emit(0)
    qtbot.waitUntil(
        lambda: panel.camera.state.format == CameraFormat("MJPG", 128, 96, 30.0), timeout=WAIT_MS
    )
    qtbot.waitUntil(panel.formats.warning.isVisible, timeout=WAIT_MS)
    assert "Choose an uncompressed format" in panel.formats.warning.text()
    assert "19 grey levels" in caplog.text


@pytest.mark.function("Unplug and reconnect a camera")
def test_unplugging_and_reconnecting_a_camera_is_reported(context, panel, fake, qtbot, caplog):
    fake.plugged = False
    qtbot.waitUntil(lambda: "not plugged in" in panel.state.text(), timeout=WAIT_MS)
    assert not panel.lock.isEnabled()
    fake.plugged = True
    qtbot.waitUntil(panel.lock.isEnabled, timeout=WAIT_MS)
    assert f"{C310.name} is connected again." in caplog.text


@pytest.mark.function("Use the settings of the calibration")
def test_a_camera_is_kept_at_the_settings_of_the_calibration(context, panel, fake, qtbot, caplog):
    fake.ignores = {"gain"}
    controls = {"exposure_auto": 0.0, "exposure_ms": 12.0, "white_balance_auto": 0.0, "gain": 9.0}
    stored = CameraSettings(C310.name, C310.identity, C310.model, "YUYV", (128, 96), 7.5, controls)
    context.cameras.set_reference("the calibration", stored)
    qtbot.waitUntil(lambda: values(panel.camera)["exposure_ms"] == 12.0, timeout=WAIT_MS)
    words = "differ from those for the calibration: Gain is 64, not 9"
    qtbot.waitUntil(lambda: words in caplog.text, timeout=WAIT_MS)
    qtbot.waitUntil(lambda: "Gain is 64, not 9" in panel.state.text(), timeout=WAIT_MS)
    assert context.status.value.camera_note == "not set as for the calibration"
    fake.ignores = set()
    qtbot.waitUntil(panel.restore.isEnabled, timeout=WAIT_MS)
    qtbot.mouseClick(panel.restore, Qt.MouseButton.LeftButton)
    qtbot.waitUntil(lambda: values(panel.camera)["gain"] == 9.0, timeout=WAIT_MS)
    qtbot.waitUntil(lambda: not panel.restore.isEnabled(), timeout=WAIT_MS)
    # Settings of another camera are not used, also of the same model.
    twin = replace(stored, identity="046d:081b@SN2", controls={**controls, "exposure_ms": 15.0})
    other = replace(twin, identity="1:2@x", model="0001:0002", name="Other")
    for device in (twin, other):
        context.cameras.set_reference("the calibration", device)
        words = f"another camera than {device.name}"
        qtbot.waitUntil(lambda words=words: words in panel.state.text(), timeout=WAIT_MS)
        assert not panel.restore.isEnabled()
        assert values(panel.camera)["exposure_ms"] == 12.0


def test_camera_settings_are_stored_without_a_session(context, panel, fake, qtbot):
    context.cameras.set(panel.camera, {"exposure_auto": 0.0, "exposure_ms": 8.0})
    qtbot.waitUntil(lambda: values(panel.camera)["exposure_ms"] == 8.0, timeout=WAIT_MS)
    panel.hide()
    fake.forgets = True
    context.cameras.driver = FakeDriver(fake)  # as after a restart
    info = context.cameras.infos()[0]
    stream = Stream(info.open())
    stream.start()
    stream.capture(1).result(60.0)
    stream.stop()
    assert fake.settings["exposure_ms"].value == 8.0


def test_a_camera_without_settings_is_reported(context, host, qtbot):
    context.cameras.driver = FakeDriver(FakeCamera(settings={}, formats=()))
    camera = context.cameras.of(context.cameras.infos()[0])
    shown = show_camera_dialog(context.cameras, camera, host)
    qtbot.waitUntil(lambda: "its manufacturer's program" in shown.state.text(), timeout=WAIT_MS)
    assert not shown.lock.isEnabled()
    assert "does not report the formats" in shown.formats.warning.text()
    shown.hide()
