"""The residuals of the captures: worst first, and offered for repetition."""

from pathlib import Path

from PySide6.QtCore import Qt

from gelpolight_core.calibration.ball_stage import BALLS
from gelpolight_core.session.session import read_session


def test_the_worst_press_is_excluded_to_be_repeated_and_undo_restores_it(
    technician, computed_project, qtbot
):
    technician.begin(computed_project(), "balls")
    panel, project = technician.wizard.panel, technician.wizard.project

    def shown_worst() -> str:
        return technician.wizard.model.page.worst_first[0].path.name

    misfits = {press.name: press.shading_misfit for press in project.results[BALLS].presses}
    worst = Path(max(misfits, key=lambda name: misfits[name])).name
    assert len(panel.residuals.texts()) >= len(misfits)
    panel.details.click()
    technician.click("calibrate.residuals.repeat")
    assert {Path(name).name for name in read_session(technician.session).decisions.excluded} == {
        worst
    }
    technician.rest()
    assert shown_worst() != worst
    qtbot.keyClick(technician.wizard, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    technician.rest()
    assert read_session(technician.session).decisions.excluded == frozenset()
    assert shown_worst() == worst
