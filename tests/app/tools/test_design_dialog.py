"""The dialog of the design check: run in the background, stopped, saved."""

import pytest
from PySide6.QtWidgets import QFileDialog

from app.tools import design_dialog
from app.tools.design_dialog import DesignDialog
from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.errors import InputError


@pytest.fixture
def dialog(context, qtbot):
    made = DesignDialog(SensorDesign(), context=context)
    qtbot.addWidget(made)
    made.show()
    return made


def test_the_design_is_checked_while_live_processing_rests_and_the_table_saved(
    dialog, context, qtbot, monkeypatch, tmp_path
):
    asked: list[bool] = []
    context.requests.rest.connect(asked.append)
    dialog.start.click()
    qtbot.waitUntil(lambda: dialog.result_shown is not None)
    assert asked == [True, False]
    rows = len(dialog.table.shown)
    assert rows > 5
    assert "The design" in dialog.words.text()
    monkeypatch.setattr(QFileDialog, "getExistingDirectory", lambda *_: str(tmp_path))
    dialog.save.click()
    qtbot.waitUntil(lambda: not dialog.jobs.busy)
    lines = (tmp_path / "design-check.csv").read_text("utf-8").splitlines()
    assert len(lines) == 1 + rows
    assert context.settings.folder("report") == tmp_path


def test_a_refusal_is_one_sentence(dialog, qtbot, monkeypatch):
    def refuse(*_: object, **__: object) -> object:
        raise InputError("The LEDs are in a row", where="design", advice="Move one")

    monkeypatch.setattr(design_dialog, "check_design", refuse)
    dialog.start.click()
    qtbot.waitUntil(lambda: "in a row" in dialog.words.text())
