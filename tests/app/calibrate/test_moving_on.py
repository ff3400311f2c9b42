"""The wizard captures, signals and continues by itself, and says why it does not."""

import numpy as np
import pytest
from PySide6.QtCore import QEvent, QPointF, Qt
from PySide6.QtGui import QMouseEvent
from PySide6.QtWidgets import QApplication
from technician import read_rgb

from app.calibrate import moving_on
from app.services.settings import Settings
from gelpolight_core.calibration.status import StageState


@pytest.fixture
def automatic(context, technician, monkeypatch):
    """Switch automatic captures on, and go on without a pause."""
    monkeypatch.setattr(moving_on, "TICK_MS", 10)
    context.settings.prefer(captures_automatically=True)


def test_a_completed_step_leads_to_the_next_one_that_needs_the_user_and_back(
    automatic, technician, camera, computed_project, small_session
):
    project = computed_project()
    former = project.session.found("background")[0]
    project.exclude("background", former.name)
    image = read_rgb(small_session / "background" / "background.png")
    camera.show(np.full_like(image, 3))
    technician.begin(project, "background")
    wizard = technician.wizard
    technician.until(lambda: wizard.panel.live.text())
    camera.show(image)
    technician.until(lambda: wizard.open.key != "background")
    assert wizard.open.key == "balls", "they must be compared with the new background"
    assert len(project.session.found("background")) == 1
    technician.rest()
    wizard.go_to("background")
    technician.rest()
    assert not wizard.moving_on.isActive(), "who comes back is not sent on again"


def test_what_needs_reading_or_nothing_new_does_not_lead_on(
    automatic, technician, computed_project, monkeypatch
):
    technician.begin(computed_project(), "background")
    wizard, step = technician.wizard, technician.wizard.open
    wizard.moving_on.setInterval(60_000)
    for state, leads_on in ((StageState.WARN.value, False), (StageState.PASS.value, True)):
        wizard.moving_on._was_incomplete = True
        wizard.model.page.states["background"] = (state, "")
        assert step.is_settled(state) is leads_on
        wizard.moving_on.check()
        assert wizard.moving_on.isActive() is leads_on
    wizard.moving_on.stop()
    technician.rest()


def test_any_action_stops_the_countdown_and_a_moving_mouse_delays_it(
    automatic, technician, computed_project, qtbot
):
    technician.begin(computed_project(), "background")
    wizard = technician.wizard
    moving, title = wizard.moving_on, wizard.panel.title
    moving.setInterval(60_000)
    none, point = Qt.MouseButton.NoButton, QPointF(5, 5)
    move = QMouseEvent(
        QEvent.Type.MouseMove, point, point, none, none, Qt.KeyboardModifier.NoModifier
    )
    for stop in (
        lambda: qtbot.mouseClick(title, Qt.MouseButton.LeftButton),
        lambda: qtbot.keyClick(wizard, Qt.Key.Key_Shift),
    ):
        # No event loop runs in here: what the page shows cannot change in between.
        wizard.model.page.states["background"] = (StageState.PASS.value, "")
        wizard.model.update_page(shown="")  # without a camera, the newest capture is shown
        moving._was_incomplete = True
        moving.check()
        moving.timeout.emit()
        assert "(2)" in wizard.panel.next.text()
        QApplication.sendEvent(title, move)
        assert "(3)" in wizard.panel.next.text()
        stop()
        assert not moving.isActive() and "(" not in wizard.panel.next.text()
        assert wizard.open.key == "background"
    technician.rest()


def test_next_is_refused_with_the_reason_while_a_step_is_incomplete(
    technician, context, computed_project, tmp_path
):
    project = computed_project()
    for path in project.session.found("mirror"):
        project.exclude("lights", path.name)
    technician.begin(project, "lights")
    technician.click("calibrate.next")
    assert technician.wizard.open.key == "lights"
    assert technician.wizard.panel.notice.text() == technician.wizard.open.obstacle() != ""
    project.exclude("lights", project.session.captured("mirror")[0].name, False)
    technician.wizard.model.changed.emit()
    technician.click("calibrate.next")
    assert technician.wizard.open.key == "radiance"
    # Automatic captures are on for a new user, and the change is remembered.
    assert Settings(tmp_path / "new.ini").preferences.captures_automatically
    assert not technician.wizard.panel.automatic.isChecked()
    technician.wizard.panel.automatic.trigger()
    assert context.settings.preferences.captures_automatically
    technician.rest()


def test_a_good_image_that_was_there_before_asks_for_a_movement(
    automatic, technician, camera, computed_project, small_session
):
    project = computed_project()
    camera.show(read_rgb(small_session / "balls" / "ball_01.png"))
    technician.begin(project, "balls")
    technician.wizard.at("balls").radius.setValue(
        2.0 * project.session.ball_radius_mm("ball_01.png")
    )
    panel, count = technician.wizard.panel, len(project.session.captured("balls"))
    technician.until(lambda: panel.live.property("meaning") == "pass")
    technician.until(lambda: "Move it" in panel.live.text())
    seen = []
    technician.wizard.model.live.processed.connect(lambda item: seen.append(item.result))
    technician.until(lambda: seen and seen[-1].still)
    assert not technician.wizard.model.live.capturing
    assert len(project.session.captured("balls")) == count
    technician.rest()
