"""The button that shows the calibration in use."""

import pytest
import scene
from PySide6.QtGui import QAction

from app.program.calibration_status import show_in_use
from app.window.state_bar import CalibrationButton


@pytest.mark.function("Choose a calibration, by name and sensor")
def test_the_calibrations_of_the_library_are_offered_and_one_is_used(context, qtbot):
    path = context.workspace.keep_calibration(scene.calibration(), "made")
    context.requests.calibrations_changed.connect(lambda: show_in_use(context))
    button = CalibrationButton(context=context)
    qtbot.addWidget(button)
    button.list_calibrations()
    action = button.findChild(QAction, f"state.calibration.{path.stem}")
    assert not action.isChecked()
    action.trigger()
    assert context.workspace.in_use == path
    assert button.property("ground") == "warn", "it is not validated"
    button.list_calibrations()
    assert button.findChild(QAction, f"state.calibration.{path.stem}").isChecked()
    button.findChild(QAction, "state.calibration.none").trigger()
    assert context.workspace.in_use is None and not button.property("ground")


def test_while_a_sensor_is_calibrated_the_button_shows_the_step(context, qtbot, tmp_path):
    button = CalibrationButton(context=context)
    qtbot.addWidget(button)
    before = button.text()
    context.status.update(task="Calibrating: 7 of 9")
    assert button.text() == "Calibrating: 7 of 9"
    context.status.update(task="")
    assert button.text() == before
