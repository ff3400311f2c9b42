"""The side panel shows the data of its own step."""

from __future__ import annotations

from PySide6.QtCore import QPoint
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
    panel.show_state("pass", "Good.", [QualityTable((figure,))], finished=True)
    assert panel.quality.texts() and panel.finished
    panel.show_step(first, following=second.title)
    assert panel.quality.texts()
    panel.show_step(second, following="")
    panel.show_running()
    assert not panel.quality.texts() and panel.quality.isHidden()
    assert not panel.finished


def test_nothing_moves_when_a_message_or_a_result_appears(qtbot: QtBot) -> None:
    panel = StepPanel()
    qtbot.addWidget(panel)
    lens = steps_of(route_of(FULL.stages))[1]
    panel.show_step(lens, following="Top surface")
    panel.resize(panel.width(), 600)
    with qtbot.waitExposed(panel):
        panel.show()
    panel.show_state("empty", "", (), finished=False)
    fixed = panel.capture, panel.next, panel.details, panel.number

    def places() -> list[QPoint]:
        panel.layout().activate()
        return [widget.mapTo(panel, QPoint()) for widget in fixed]

    before = places()
    figure = Finding("k", "Error of a figure with a long name in two lines", 2.0, "px")
    for act in (
        lambda: panel.show_live("One sentence. " * 12, ready=False),
        lambda: panel.show_number(figure, "3 of 12 captured"),
        lambda: panel.show_notice("The disk is full. Free some disk space.", "fail"),
        lambda: panel.show_state(
            "fail", "It failed.", [QualityTable((figure,))],
            remedies=(("Repeat it", panel.hide),), finished=False,
        ),
        lambda: panel.show_work("Computing", 0.3),
        lambda: panel.show_countdown(3),
    ):  # fmt: skip
        act()
        assert places() == before


def test_the_first_remedies_are_buttons_and_an_action_that_failed_comes_first(
    qtbot: QtBot,
) -> None:
    panel = StepPanel()
    qtbot.addWidget(panel)
    panel.show_step(steps_of(route_of(FULL.stages))[6], following="Result")
    done: list[str] = []
    remedies = [(name, lambda name=name: done.append(name)) for name in ("a", "b", "c", "d")]
    panel.show_state("warn", "Not good.", (), remedies=remedies, finished=False)
    assert [button.text() for button in panel.buttons] == ["a", "b", "c"]
    panel.buttons[1].click()
    assert done == ["b"]
    panel.show_notice("The disk is full.", "fail")
    assert panel.sentence.isHidden() and panel.buttons[0].isHidden()
    panel.show_notice("", "pass")
    assert not panel.sentence.isHidden() and not panel.buttons[0].isHidden()


def test_a_complete_step_without_a_figure_waits_for_none(qtbot: QtBot) -> None:
    panel = StepPanel()
    qtbot.addWidget(panel)
    for waits, text in ((True, "No result yet"), (False, "")):
        panel.show_number(None, "", waits=waits)
        assert panel.caption.text() == text
