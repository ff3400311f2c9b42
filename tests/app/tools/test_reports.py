"""The reports of the Tools menu: run in the background, filtered, saved."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import pytest
from PySide6.QtWidgets import QFileDialog
from pytestqt.qtbot import QtBot

from app.context.context import AppContext
from app.tools import design_report, stability_report
from app.tools.design_report import DesignReport
from app.tools.report_dialog import ReportDialog
from app.tools.stability_report import StabilityReport
from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.design_check.lighting import LightingRow
from gelpolight_core.errors import InputError
from gelpolight_core.experiments.stability import Case, Seen

CASES = (
    Case("right", "images", "a good image", "right", lambda: Seen(True, "as required", error_um=1)),
    Case("wrong", "lights", "a bad light", "right", lambda: Seen(False, "off by far", error_um=99)),
)
LIGHT = LightingRow("point", 13.75, 12.0, 0.2, 7.9, 165.8, -2.0, 52.0)


@pytest.fixture
def stability(
    context: AppContext, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> Iterator[ReportDialog]:
    monkeypatch.setattr(stability_report, "all_cases", lambda: CASES)
    dialog = ReportDialog(StabilityReport(), context=context)
    dialog.show()
    yield dialog
    dialog.close()
    dialog.deleteLater()


def finish(dialog: ReportDialog, qtbot: QtBot) -> None:
    dialog.start.click()
    qtbot.waitUntil(lambda: dialog.result_shown is not None, timeout=30_000)


def shown(dialog: ReportDialog) -> list[str]:
    table = dialog.table
    rows = [r for r in range(table.rowCount()) if not table.isRowHidden(r)]
    return [table.item(row, 0).text() for row in rows]  # type: ignore[union-attr]


def test_cases_run_in_the_background_while_live_processing_rests(
    stability: ReportDialog, context: AppContext, qtbot: QtBot
) -> None:
    asked: list[bool] = []
    context.requests.rest.connect(asked.append)
    finish(stability, qtbot)
    assert asked == [True, False]
    assert shown(stability) == ["a good image", "a bad light"]
    assert not stability.grab().isNull()


def test_the_table_shows_what_the_filter_asks_for(stability: ReportDialog, qtbot: QtBot) -> None:
    finish(stability, qtbot)
    qtbot.keyClicks(stability.filter, "OFF BY")
    assert shown(stability) == ["a bad light"]
    stability.filter.clear()
    assert len(shown(stability)) == 2


def test_one_subject_can_be_chosen_and_the_report_saved(
    stability: ReportDialog,
    context: AppContext,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    qtbot: QtBot,
) -> None:
    stability.choice.setCurrentIndex(stability.choice.findData("lights"))
    finish(stability, qtbot)
    assert shown(stability) == ["a bad light"]
    monkeypatch.setattr(QFileDialog, "getExistingDirectory", lambda *_: str(tmp_path))
    stability.save.click()
    qtbot.waitUntil(lambda: not stability.jobs.busy, timeout=30_000)
    assert (tmp_path / "stability.html").is_file()
    assert context.settings.folder("report") == tmp_path


def test_stopping_ends_the_work_and_it_can_be_started_again(
    context: AppContext, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    begun = threading.Event()

    def endless(*_: object, progress: Callable[[str, float], None]) -> Sequence[LightingRow]:
        begun.set()
        while True:
            progress("light", 0.5)

    monkeypatch.setattr(design_report, "compare_lighting", endless)
    dialog = ReportDialog(DesignReport(SensorDesign()), context=context)
    qtbot.addWidget(dialog)
    dialog.show()
    dialog.start.click()
    assert begun.wait(30.0)
    dialog.stop.click()
    qtbot.waitUntil(lambda: not dialog.jobs.busy, timeout=30_000)
    assert dialog.start.isEnabled() and dialog.result_shown is None


def test_the_design_check_shows_figures_and_both_kinds_of_light(
    context: AppContext, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(design_report, "compare_lighting", lambda *_, **__: (LIGHT,))
    dialog = ReportDialog(DesignReport(SensorDesign()), context=context)
    qtbot.addWidget(dialog)
    dialog.show()
    finish(dialog, qtbot)
    assert shown(dialog)[-1] == "point, LEDs at 13.8 mm"
    assert dialog.table.rowCount() > 5
    dialog.write_report(tmp_path)
    qtbot.waitUntil(lambda: not dialog.jobs.busy, timeout=30_000)
    assert "7.9 um" in (tmp_path / "design-check.html").read_text("utf-8")


def test_a_refusal_is_one_sentence(
    context: AppContext, qtbot: QtBot, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> object:
        raise InputError("The LEDs are in a row", where="design", advice="Move one")

    monkeypatch.setattr(design_report, "check_design", refuse)
    dialog = ReportDialog(DesignReport(SensorDesign()), context=context)
    qtbot.addWidget(dialog)
    dialog.show()
    dialog.start.click()
    qtbot.waitUntil(lambda: "in a row" in dialog.words.text(), timeout=30_000)
