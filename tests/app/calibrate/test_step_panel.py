"""The side panel shows the state of the page."""

from dataclasses import replace
from typing import Any

import pytest

from app.calibrate.page_state import PageState
from app.calibrate.step_panel import StepPanel
from app.calibrate.wizard import route_of
from gelpolight_core.base.finding import Finding, QualityTable, Verdict
from gelpolight_core.calibration.recipes import FULL

FIGURE = Finding("k", "Error of a figure with a long name in two lines", 2.0, "px")


def page_of(place: int, **shown: Any) -> PageState:
    """Return the page at one of the steps of a sensor that can be opened."""
    steps: Any = route_of(FULL.stages)
    return PageState(steps, steps[place], **shown)


@pytest.fixture
def panel(qtbot):
    panel = StepPanel()
    qtbot.addWidget(panel)
    return panel


def test_a_step_in_computation_does_not_show_figures_of_another_step(panel):
    figure = replace(FIGURE, verdict=Verdict.PASS)
    panel.show_page(page_of(1, state="pass", tables=(QualityTable((figure,)),), finished=True))
    assert panel.quality.table.figures
    panel.show_page(page_of(2, state="running"))
    assert not panel.quality.table.figures and panel.quality.isHidden()


def test_the_first_remedies_are_buttons_and_an_action_that_failed_comes_first(panel):
    done: list[str] = []
    remedies = [(name, lambda name=name: done.append(name)) for name in ("a", "b", "c", "d")]
    page = page_of(6, state="warn", sentence="Not good.", remedies=remedies)
    panel.show_page(page)
    assert [button.text() for button in panel.buttons] == ["a", "b", "c"]
    panel.buttons[1].click()
    assert done == ["b"]
    panel.show_page(replace(page, notice=("The disk is full.", "fail")))
    assert panel.sentence.isHidden() and not panel.buttons[0].isHidden()
    panel.show_page(page)
    assert not panel.sentence.isHidden() and not panel.buttons[0].isHidden()


def test_a_complete_step_without_a_figure_waits_for_none(panel):
    for state, text in (("waiting", "No result yet"), ("pass", "")):
        panel.show_page(page_of(1, state=state))
        assert panel.caption.text() == text
