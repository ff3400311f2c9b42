"""The table of the captures' residuals: worst first, and offered for repetition."""

from __future__ import annotations

import math
from pathlib import Path

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QTableWidget
from pytestqt.qtbot import QtBot
from technician import Technician
from test_wizard import Made

from app.calibrate.film_strip import Capture
from app.calibrate.residual_table import ResidualTable
from gelpolight_core.calibration.ball_stage import BALLS
from gelpolight_core.finding import Finding, Verdict
from gelpolight_core.session.session import read_session


def capture(name: str, value: float, verdict: Verdict = Verdict.PASS) -> Capture:
    """Return a capture with its residual."""
    finding = Finding("corner_error_px", "Corner error", value, "px", verdict=verdict)
    return Capture(Path(name), finding)


CAPTURES = (
    capture("a.png", 0.1),
    capture("b.png", 0.4, Verdict.WARN),
    capture("c.png", math.nan, Verdict.FAIL),
    capture("d.png", 0.25),
)


def shown(qtbot: QtBot) -> ResidualTable:
    table = ResidualTable()
    qtbot.addWidget(table)
    table.show_captures(CAPTURES, shown="d.png")
    table.show()
    return table


def grid_of(table: ResidualTable) -> QTableWidget:
    grid = table.findChild(QTableWidget)
    assert isinstance(grid, QTableWidget)
    return grid


def test_the_worst_capture_is_first_and_one_without_a_residual_is_left_out(qtbot: QtBot) -> None:
    table = shown(qtbot)
    assert table.texts() == [("b", "0.4"), ("d", "0.25"), ("a", "0.1")]
    assert [index.row() for index in grid_of(table).selectionModel().selectedRows()] == [1]


def test_a_click_on_a_row_chooses_the_capture(qtbot: QtBot) -> None:
    table = shown(qtbot)
    grid = grid_of(table)
    with qtbot.waitSignal(table.chosen) as chosen:
        at = grid.visualItemRect(grid.item(2, 0)).center()
        qtbot.mouseClick(grid.viewport(), Qt.MouseButton.LeftButton, pos=at)
    assert chosen.args == ["a.png"]


def test_the_worst_press_is_excluded_to_be_repeated_and_undo_restores_it(
    technician: Technician, computed_project: Made, qtbot: QtBot
) -> None:
    technician.begin(computed_project(), "balls")
    table, project = technician.wizard.panel.residuals, technician.wizard.project
    misfits = {press.name: press.shading_misfit for press in project.results[BALLS].presses}
    worst = max(misfits, key=lambda name: misfits[name])
    assert len(table.texts()) == len(misfits)
    qtbot.mouseClick(table.repeat, Qt.MouseButton.LeftButton)
    assert read_session(technician.session).decisions.excluded == {worst}
    technician.rest()
    assert f"{table.texts()[0][0]}.png" != Path(worst).name
    qtbot.keyClick(technician.wizard, Qt.Key.Key_Z, Qt.KeyboardModifier.ControlModifier)
    technician.rest()
    assert read_session(technician.session).decisions.excluded == frozenset()
    assert f"{table.texts()[0][0]}.png" == Path(worst).name
