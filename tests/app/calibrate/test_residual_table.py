"""The residuals of the captures: worst first, and offered for repetition."""

from __future__ import annotations

import math
from pathlib import Path

from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot
from technician import Technician
from test_step_panel import page_of
from test_wizard import Made

from app.calibrate.page_state import Capture
from app.calibrate.step_panel import StepPanel
from gelpolight_core.calibration.ball_stage import BALLS
from gelpolight_core.finding import Finding, Verdict
from gelpolight_core.session.session import read_session


def capture(name: str, value: float, verdict: Verdict = Verdict.PASS) -> Capture:
    """Return a capture with its residual."""
    finding = Finding("corner_error_px", "Corner error", value, "px", verdict=verdict)
    return Capture(Path(name), finding)


def test_the_worst_capture_is_first_and_one_without_a_residual_is_left_out(qtbot: QtBot) -> None:
    panel = StepPanel()
    qtbot.addWidget(panel)
    values = {"a.png": 0.1, "b.png": 0.4, "c.png": math.nan, "d.png": 0.25}
    captures = tuple(capture(*one) for one in values.items())
    panel.show_page(page_of(1, captures=captures))
    assert [row[1:3] for row in panel.residuals.texts()] == [
        ["b", "0.4 px"], ["d", "0.25 px"], ["a", "0.1 px"],
    ]  # fmt: skip
    assert panel.residual.text() == "Corner error"


def test_the_worst_press_is_excluded_to_be_repeated_and_undo_restores_it(
    technician: Technician, computed_project: Made, qtbot: QtBot
) -> None:
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
