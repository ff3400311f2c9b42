"""The overview of a calibration does not keep texts of an earlier one."""

from __future__ import annotations

from pytestqt.qtbot import QtBot

from app.calibrate.lens import LensStep
from app.calibrate.result import ResultView
from gelpolight_core.calibration.status import StageState, StageStatus


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
