"""The overview of a calibration does not keep texts of an earlier one."""

from __future__ import annotations

from PySide6.QtWidgets import QLabel
from pytestqt.qtbot import QtBot

from app.calibrate.lens import LensStep
from app.calibrate.result import ResultView
from gelpolight_core.calibration.status import StageState, StageStatus, judged_by
from gelpolight_core.causes import MODEL, with_one_cause
from gelpolight_core.finding import QualityTable, judge


def _show(view: ResultView, state: StageState, *, saved: str) -> None:
    status = StageStatus(state, "")
    view.show_states({"lens": (state.value, "")}, {"lens": status}, busy=False, saved=saved)


def test_where_it_was_saved_is_shown_until_the_captures_change(qtbot: QtBot) -> None:
    view = ResultView((LensStep.describe(),))
    qtbot.addWidget(view)
    _show(view, StageState.PASS, saved="")
    view.show_saved("Saved as /library/a.gplcal")
    _show(view, StageState.PASS, saved="")  # before the name of the new calibration is known
    _show(view, StageState.PASS, saved="a")
    assert "a.gplcal" in view.saved.text()
    _show(view, StageState.STALE, saved="")
    assert view.saved.text().strip() == ""
    assert "a.gplcal" not in view.headline.text()


def test_the_most_likely_cause_is_shown_once_and_what_follows_from_it_has_no_remedy(
    qtbot: QtBot,
) -> None:
    poor = [judge(key, key, 2.0, warn=1.0, remedy="Coat it again") for key in MODEL]
    cause, tables = with_one_cause({"lens": QualityTable(tuple(poor))})
    status = judged_by(tables["lens"], cause=cause)
    view = ResultView((LensStep.describe(),))
    qtbot.addWidget(view)
    sentence = ("warn", status.sentence)
    view.show_states({"lens": sentence}, {"lens": status}, busy=False)
    assert view.cause.text() == status.sentence == "Most likely cause: Check the LED height."
    shown = [label.text() for label in view.findChildren(QLabel) if not label.isHidden()]
    assert sum("LED height" in text for text in shown) == 1
    assert not any("Coat it again" in text for text in shown)
