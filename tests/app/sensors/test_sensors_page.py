"""The Sensors page: what a technician sees of the library, and does with it."""

from __future__ import annotations

from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest
import scene
from PySide6.QtWidgets import (
    QFileDialog,
    QLabel,
    QProgressBar,
    QTableView,
    QToolButton,
    QWidget,
)
from pytestqt.qtbot import QtBot

from app.sensors.model import cells_of
from app.sensors.page import SensorsPage
from app.sensors.report_writer import write_entry_report
from app.shell.context import AppContext
from app.shell.settings import Limits
from app.widgets.quality_table import QualityTableWidget
from app.workspace.entries import read_entry
from app.workspace.validation import Comparison, Validation, write_validation
from gelpolight_core.calibration.file import write_calibration


@pytest.fixture(scope="module")
def source(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a calibration file somewhere else."""
    path = tmp_path_factory.mktemp("elsewhere") / "made.gplcal"
    write_calibration(scene.calibration(), path)
    return path


@pytest.fixture
def page(context: AppContext, qtbot: QtBot) -> Iterator[SensorsPage]:
    host = QWidget()
    qtbot.addWidget(host)
    context.toasts.attach(host, lambda: None)
    made = SensorsPage(context=context)
    qtbot.addWidget(made)
    made.resize(1100, 700)
    made.show()
    yield made


def words(page: QWidget) -> str:
    return "\n".join(label.text() for label in page.findChildren(QLabel) if label.isVisible())


def test_a_first_start_offers_ways_to_begin(page: SensorsPage) -> None:
    assert "No sensor yet" in words(page)
    buttons = [b for b in page.findChildren(QToolButton) if b.isVisible()]
    assert any(button.objectName() == "welcome.sensors.import" for button in buttons)


def test_a_new_sensor_is_asked_for_and_not_the_page_of_another(
    page: SensorsPage, context: AppContext, qtbot: QtBot
) -> None:
    with qtbot.waitSignal(context.requests.new_sensor):
        page.new.trigger()


def test_an_imported_calibration_is_shown_with_every_stage(
    page: SensorsPage, source: Path, context: AppContext
) -> None:
    page.open_path(source)
    chosen = page.chosen()
    assert chosen is not None
    assert chosen.summary is not None
    shown = [t.objectName() for t in page.findChildren(QualityTableWidget) if t.isVisible()]
    assert shown == [f"sensors.quality.{stage}" for stage in chosen.summary.quality]
    assert "Not validated" in words(page)
    assert "library" in context.toasts.shown()[0].text


def test_using_one_that_is_not_validated_warns(
    page: SensorsPage, source: Path, context: AppContext
) -> None:
    page.open_path(source)
    page.use.trigger()
    chosen = page.chosen()
    assert chosen is not None
    assert chosen.in_use
    assert context.status.value.calibration == scene.calibration().identity
    assert context.status.value.calibration_note == "not validated"
    assert context.toasts.shown()[-1].kind == "warn"
    assert not page.use.isEnabled()


def test_a_validated_one_says_so(page: SensorsPage, source: Path, context: AppContext) -> None:
    page.open_path(source)
    chosen = page.chosen()
    assert chosen is not None
    passed = Comparison("height", 1.02, 1.0, 8.0)
    identity = scene.calibration().identity
    write_validation(
        Validation(identity, "2026-03-01T12:00:00+00:00", "Ada", "cylinder 5 mm", (passed,)),
        chosen.path,
    )
    context.requests.calibrations_changed.emit()
    assert "Validated: cylinder 5 mm" in words(page)
    assert "+2.0 %" in words(page)
    count = len(context.toasts.shown())
    page.use.trigger()
    assert context.status.value.calibration_note == "validated"
    assert len(context.toasts.shown()) == count


def test_a_removed_one_comes_back_by_undo(
    page: SensorsPage, source: Path, context: AppContext
) -> None:
    page.open_path(source)
    page.use.trigger()
    page.remove.trigger()
    assert "No sensor yet" in words(page)
    assert context.status.value.calibration is None
    undo = context.toasts.shown()[-1].findChild(QWidget, "toast.action0")
    undo.click()
    assert page.chosen() is not None
    assert context.status.value.calibration is not None


def test_a_broken_file_is_shown_with_its_reason(
    page: SensorsPage, source: Path, context: AppContext
) -> None:
    folder = context.workspace.sensor_folder("A-9")
    folder.mkdir(parents=True)
    (folder / "half.gplcal").write_bytes(source.read_bytes()[:400])
    page.refresh()
    chosen = page.chosen()
    assert chosen is not None
    assert chosen.broken
    assert "cannot be read" in words(page)
    assert not page.use.isEnabled()
    assert page.remove.isEnabled()


def test_a_broken_file_is_refused_in_a_sentence(
    page: SensorsPage, context: AppContext, tmp_path: Path
) -> None:
    (tmp_path / "bad.gplcal").write_text("no calibration")
    page.open_path(tmp_path / "bad.gplcal")
    assert "damaged" in context.toasts.shown()[0].text
    assert "No sensor yet" in words(page)


def test_what_was_chosen_stays_chosen(
    page: SensorsPage, source: Path, context: AppContext, tmp_path: Path
) -> None:
    page.open_path(source)
    for serial in ("0-before", "z-after"):
        folder = context.workspace.sensor_folder(serial)
        folder.mkdir(parents=True)
        (folder / "x.gplcal").write_text("broken")
    before = page.chosen()
    page.enter()
    assert page.chosen() == before


def test_an_old_calibration_is_marked(source: Path) -> None:
    entry = read_entry(source)
    made = entry.created
    assert made is not None
    limit = Limits().age_days
    young = cells_of(entry, made + timedelta(days=limit - 1), limit)
    old = cells_of(entry, made + timedelta(days=limit + 1), limit)
    assert young[3].icon == ""
    assert old[3].icon == "stale"
    assert "calibrate again" in old[3].tip


def test_every_column_of_every_row_has_a_text_or_a_tip(source: Path, tmp_path: Path) -> None:
    (tmp_path / "x.gplcal").write_text("broken")
    for path in (source, tmp_path / "x.gplcal"):
        cells = cells_of(read_entry(path, in_use=True), datetime.now(UTC), 90.0)
        assert all(cell.text or cell.tip for cell in cells if cell.icon)


def session_of(context: AppContext, serial: str) -> Path:
    folder = context.workspace.sessions_folder(serial) / "2026-01-02"
    folder.mkdir(parents=True)
    (folder / "session.toml").write_text(f'[sensor]\nserial = "{serial}"\n')
    return folder


def test_a_session_is_gone_on_with_also_before_there_is_a_calibration(
    page: SensorsPage, context: AppContext, qtbot: QtBot
) -> None:
    folder = session_of(context, "S-1")
    page.enter()
    assert "No sensor yet" not in words(page)
    button = page.findChild(QToolButton, "sensors.go_on.button")
    table = page.findChild(QTableView, "sensors.sessions.table")
    assert not button.isEnabled()
    table.selectRow(0)
    page.enter()  # what was chosen stays chosen
    with qtbot.waitSignal(context.requests.session) as asked:
        button.click()
    assert asked.args == [str(folder)]


@pytest.mark.parametrize("ending", ["html", "pdf"])
def test_a_report_is_written_beside_the_windows_work(
    page: SensorsPage, source: Path, context: AppContext, tmp_path: Path, qtbot: QtBot,
    monkeypatch: pytest.MonkeyPatch, ending: str,
) -> None:  # fmt: skip
    place = tmp_path / f"report.{ending}"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(place), ""))
    page.open_path(source)
    bar = page.findChild(QProgressBar, "sensors.busy")
    page.report.trigger()
    assert bar.isVisible()
    assert not page.report.isEnabled()
    qtbot.waitUntil(lambda: page.report.isEnabled(), timeout=20000)
    assert not bar.isVisible()
    assert place.stat().st_size > 1000
    assert str(place) in context.toasts.shown()[-1].text


def test_a_report_that_cannot_be_written_is_told(
    page: SensorsPage, source: Path, context: AppContext, tmp_path: Path, qtbot: QtBot,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    place = tmp_path / "nowhere" / "report.html"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(place), ""))
    page.open_path(source)
    page.report.trigger()
    qtbot.waitUntil(lambda: page.report.isEnabled(), timeout=20000)
    assert context.toasts.shown()[-1].kind == "fail"
    assert str(place.parent) in context.toasts.shown()[-1].text


def test_the_report_says_what_a_trial_came_to(source: Path, tmp_path: Path) -> None:
    place = tmp_path / "c.gplcal"
    place.write_bytes(source.read_bytes())
    write_entry_report(read_entry(place), tmp_path / "before.html")
    trial = Validation(
        read_entry(place).summary.identity, "2026-01-02T03:04:05+00:00", "M", "cylinder",
        (Comparison("height", 1.01, 1.0, 8.0),),
    )  # fmt: skip
    write_validation(trial, place)
    write_entry_report(read_entry(place), tmp_path / "after.html")
    said = [(tmp_path / f"{name}.html").read_text() for name in ("before", "after")]
    assert "1.010 mm measured" not in said[0]
    assert "Validated: cylinder" in said[1]
    assert "1.010 mm measured" in said[1]
