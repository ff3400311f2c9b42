"""The dialog of the design check: run in the background, stopped, saved."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from pathlib import Path

import pytest
from PySide6.QtWidgets import QFileDialog
from pytestqt.qtbot import QtBot

from app.context.context import AppContext
from app.tools import design_dialog
from app.tools.design_dialog import DesignDialog
from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.design_check.lighting import LightingRow
from gelpolight_core.errors import InputError

LIGHT = LightingRow("point", 13.75, 12.0, 0.2, 7.9, 165.8, -2.0, 52.0)


@pytest.fixture
def dialog(context: AppContext, qtbot: QtBot) -> DesignDialog:
    made = DesignDialog(SensorDesign(), context=context)
    qtbot.addWidget(made)
    made.show()
    return made


def test_the_design_is_checked_while_live_processing_rests_and_the_table_saved(
    dialog: DesignDialog,
    context: AppContext,
    qtbot: QtBot,
    monkeypatch: pytest.MonkeyPatch,
    tmp_path: Path,
) -> None:
    monkeypatch.setattr(design_dialog, "compare_lighting", lambda *_, **__: (LIGHT,))
    asked: list[bool] = []
    context.requests.rest.connect(asked.append)
    dialog.start.click()
    qtbot.waitUntil(lambda: dialog.result_shown is not None, timeout=30_000)
    assert asked == [True, False]
    rows = dialog.table.rowCount()
    assert rows > 5
    assert dialog.table.item(rows - 1, 0).text() == "point, LEDs at 13.8 mm"  # type: ignore[union-attr]
    assert "The design" in dialog.words.text()
    monkeypatch.setattr(QFileDialog, "getExistingDirectory", lambda *_: str(tmp_path))
    dialog.save.click()
    qtbot.waitUntil(lambda: not dialog.jobs.busy, timeout=30_000)
    lines = (tmp_path / "design-check.csv").read_text("utf-8").splitlines()
    assert len(lines) == 1 + rows and "7.9 um" in lines[-1]
    assert context.settings.folder("report") == tmp_path


def test_stopping_ends_the_work_and_it_can_be_started_again(
    dialog: DesignDialog, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun = threading.Event()

    def endless(*_: object, progress: Callable[[str, float], None]) -> Sequence[LightingRow]:
        begun.set()
        while True:
            progress("light", 0.5)

    monkeypatch.setattr(design_dialog, "compare_lighting", endless)
    dialog.start.click()
    assert begun.wait(30.0)
    dialog.stop.click()
    qtbot.waitUntil(lambda: not dialog.jobs.busy, timeout=30_000)
    assert dialog.start.isEnabled() and dialog.result_shown is None


def test_a_refusal_is_one_sentence(
    dialog: DesignDialog, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> object:
        raise InputError("The LEDs are in a row", where="design", advice="Move one")

    monkeypatch.setattr(design_dialog, "check_design", refuse)
    dialog.start.click()
    qtbot.waitUntil(lambda: "in a row" in dialog.words.text(), timeout=30_000)
