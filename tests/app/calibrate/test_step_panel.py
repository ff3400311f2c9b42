"""What stands beside a step is of that step."""

from __future__ import annotations

from pytestqt.qtbot import QtBot

from app.calibrate.step_panel import StepPanel
from app.calibrate.steps import all_steps
from gelpolight_core.quality import Figure, QualityTable, Verdict


def test_a_step_that_is_computed_does_not_show_the_figures_of_the_one_before(
    qtbot: QtBot,
) -> None:
    panel = StepPanel()
    qtbot.addWidget(panel)
    first, second = all_steps()[:2]
    figure = Figure("k", "Reprojection error", 0.2, "px", 0.3, 1.0, Verdict.PASS, "")
    panel.show_step(first, following=second.title)
    panel.show_state("pass", "Good.", [QualityTable((figure,))], recompute=False, finished=True)
    assert panel.quality.texts() and "bold" in panel.next.styleSheet()
    panel.show_step(first, following=second.title)
    assert panel.quality.texts()
    panel.show_step(second, following="")
    panel.show_running()
    assert not panel.quality.texts() and panel.quality.isHidden()
    assert not panel.finished and "bold" not in panel.next.styleSheet()


def test_the_button_says_whether_a_further_picture_takes_the_place_of_the_one_before(
    qtbot: QtBot,
) -> None:
    panel = StepPanel()
    qtbot.addWidget(panel)
    said = {}
    for step in all_steps():
        panel.show_step(step, following="")
        panel.show_count(1)
        said[step.key] = panel.capture.text().replace("&", "")
    assert said["top_pose"] == "Capture another"
    assert said["background"] == said["lights"] == "Capture again"
    assert said["balls"] == "Capture  (1 of 10)"
