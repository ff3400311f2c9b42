"""The side panel shows the data of its own step."""

from __future__ import annotations

from pytestqt.qtbot import QtBot

from app.calibrate.step_panel import StepPanel
from app.calibrate.steps import route_of, steps_of
from gelpolight_core.calibration.recipes import FULL
from gelpolight_core.finding import Finding, QualityTable, Verdict


def test_a_step_in_computation_does_not_show_figures_of_another_step(
    qtbot: QtBot,
) -> None:
    panel = StepPanel()
    qtbot.addWidget(panel)
    first, second = steps_of(route_of(FULL.stages))[:2]
    figure = Finding("k", "Reprojection error", 0.2, "px", 0.3, 1.0, Verdict.PASS, "")
    panel.show_step(first, following=second.title)
    panel.show_state("pass", "Good.", [QualityTable((figure,))], recompute=False, finished=True)
    assert panel.quality.texts() and "bold" in panel.next.styleSheet()
    panel.show_step(first, following=second.title)
    assert panel.quality.texts()
    panel.show_step(second, following="")
    panel.show_running()
    assert not panel.quality.texts() and panel.quality.isHidden()
    assert not panel.finished and "bold" not in panel.next.styleSheet()
