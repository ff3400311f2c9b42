"""The Sensors page: the library as a technician sees and uses it."""

import shutil
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
import scene
from PySide6.QtCore import QFile, Qt
from PySide6.QtWidgets import (
    QFileDialog,
    QLabel,
    QLineEdit,
    QProgressBar,
    QPushButton,
    QTableView,
    QWidget,
)
from report_pdf import report_data

from app.program.calibration_entries import read_entry
from app.program.context import AppContext
from app.program.preferences import WarningLimits
from app.sensors.details import TITLES, cells_of
from app.sensors.page import SensorsPage
from app.widgets.dialog import QuestionDialog
from app.widgets.quality_table import QualityTableWidget
from gelpolight_core.base.compared_quantity import Quantity
from gelpolight_core.calibration.annotations import write_validation
from gelpolight_core.calibration.calibration_file import read_calibration, write_calibration
from gelpolight_core.lab.measurement_record import FILE, MeasurementRecord
from gelpolight_core.lab.measurement_store import NAME
from gelpolight_core.output.recording.recording_format import RecordingHeader
from gelpolight_core.output.recording.recording_writer import RecordingWriter
from gelpolight_core.output.report.calibration_report import calibration_report
from gelpolight_core.output.report.report_pdf_file import write_report
from gelpolight_core.session.validation import Validation


@pytest.fixture(scope="module")
def source(tmp_path_factory):
    """Return a calibration file outside the library."""
    path = tmp_path_factory.mktemp("elsewhere") / "made.gplcal"
    write_calibration(scene.calibration(), path)
    return path


@pytest.fixture
def page(context, qtbot):
    host = QWidget()
    qtbot.addWidget(host)
    context.toasts.attach(host, lambda: None)
    made = SensorsPage(context=context)
    qtbot.addWidget(made)
    made.resize(1100, 700)
    made.show()
    yield made
    made.can_close()


def words(page: QWidget) -> str:
    return "\n".join(label.text() for label in page.findChildren(QLabel) if label.isVisible())


def test_a_first_start_offers_the_first_actions(page, context, qtbot):
    assert "No sensor yet" in words(page)
    buttons = [b.objectName() for b in page.findChildren(QPushButton) if b.isVisible()]
    assert {"sensors.new.button", "sensors.import.button", "sensors.demo.button"} <= set(buttons)
    with qtbot.waitSignal(context.requests.begin) as asked:
        page.offered["new"].trigger()
    assert asked.args == ["sensor"]


@pytest.mark.function(
    "See sensors, calibrations and sessions of the workspace",
    "Put a calibration into use, with a warning if it is not validated",
)
def test_an_imported_calibration_is_shown_with_every_stage_and_used_with_a_warning(
    page, source, context
):
    page.open_path(source)
    chosen = page.chosen()
    shown = [t.objectName() for t in page.findChildren(QualityTableWidget) if t.isVisible()]
    assert shown == [f"sensors.quality.{stage}" for stage in chosen.summary.quality]
    assert "Not validated" in words(page)
    assert "library" in context.toasts.shown()[0].text
    assert not chosen.validated
    page.offered["use"].trigger()
    again = page.chosen()
    assert again.in_use
    assert context.workspace.in_use == again.path
    assert context.toasts.shown()[-1].finding.verdict == "warn"
    assert not page.offered["use"].isEnabled()
    # A validated one is marked, and used without a word.
    passed = Quantity("height", 1.02, truth=1.0, limit_percent=8.0)
    identity = scene.calibration().identity
    trial = Validation(identity, "2026-03-01T12:00:00+00:00", "Ada", "cylinder 5 mm", (passed,))
    write_validation(trial, again.path)
    context.workspace.use(None)
    context.requests.calibrations_changed.emit()
    assert "Validated: cylinder 5 mm" in words(page) and "+2.00 %" in words(page)
    count = len(context.toasts.shown())
    page.offered["use"].trigger()
    assert page.chosen().in_use and page.chosen().validated
    assert len(context.toasts.shown()) == count


def test_the_details_count_the_measurements(page, source, context):
    page.open_path(source)
    assert "No measurement was saved" in words(page)
    assert not (context.workspace.folder / NAME).exists()
    chosen = page.chosen()
    for hours in range(3):
        context.workspace.records.add(
            MeasurementRecord(
                chosen.serial, chosen.summary.identity, "ball", (Quantity("height_mm", 1.0, 0.01),),
                time=datetime(2026, 3, 1, 10 + hours, tzinfo=UTC),
            )
        )  # fmt: skip
    page.refresh()
    assert "Measurements saved with it: 3" in words(page)


@pytest.mark.function("Keep a calibration that failed as a draft, and use it only with a reason")
def test_a_failed_calibration_asks_for_a_reason_that_its_report_shows(
    page, context, tmp_path, qtbot
):
    path = context.workspace.keep_calibration(scene.failed(scene.calibration()), "made")
    page.refresh()
    page.offered["use"].trigger()
    (question,) = page.findChildren(QuestionDialog)
    answer = question.findChild(QPushButton, "question.answer0")
    reason = question.findChild(QLineEdit, "question.line")
    assert "Half a pixel" in question.findChild(QLabel, "question.text").text()
    qtbot.keyClicks(reason, "  ")
    assert not answer.isEnabled()
    assert context.workspace.in_use is None
    qtbot.keyClicks(reason, "for teaching")
    answer.click()
    assert context.workspace.in_use == path
    assert "Used although it failed: for teaching" in words(page)
    write_report(calibration_report(read_calibration(path)), tmp_path / "report.pdf")
    assert ["Used although it failed", "for teaching"] in report_data(tmp_path / "report.pdf")[
        "facts"
    ]


def answer(page: QWidget, button: str) -> None:
    """Click a button of the question that is asked."""
    (question,) = (q for q in page.findChildren(QuestionDialog) if q.isVisible())
    question.findChild(QPushButton, f"question.{button}").click()


@pytest.mark.function("Remove a calibration into the trash of the system")
def test_a_calibration_is_removed_into_the_trash_of_the_system_after_a_question(
    page, source, context, tmp_path
):
    page.open_path(source)
    page.offered["use"].trigger()
    path = page.chosen().path
    content = path.read_bytes()
    page.offered["remove"].trigger()
    (question,) = page.findChildren(QuestionDialog)
    default = [button for button in question.findChildren(QPushButton) if button.isDefault()]
    assert [button.objectName() for button in default] == ["question.cancel"]
    answer(page, "cancel")
    assert page.chosen() is not None
    page.offered["remove"].trigger()
    answer(page, "answer0")
    assert "No sensor yet" in words(page)
    assert context.workspace.in_use is None and not path.exists()
    (trashed,) = tmp_path.rglob("Trash/files/*.gplcal")
    assert trashed.read_bytes() == content


def test_nothing_is_deleted_where_the_system_has_no_trash(page, source, context, monkeypatch):
    page.open_path(source)
    page.offered["use"].trigger()
    path = page.chosen().path
    monkeypatch.setattr(QFile, "moveToTrash", lambda _path: False)
    page.offered["remove"].trigger()
    answer(page, "answer0")
    assert path.is_file() and page.chosen().path == path == context.workspace.in_use
    assert "not deleted" in context.toasts.shown()[-1].text


def test_a_broken_file_is_shown_with_its_reason(page, source, context):
    folder = context.workspace.sensor_folder("A-9")
    folder.mkdir(parents=True)
    (folder / "half.gplcal").write_bytes(source.read_bytes()[:400])
    page.refresh()
    chosen = page.chosen()
    assert chosen.broken
    assert "cannot be read" in words(page)
    assert not page.offered["use"].isEnabled()
    assert page.offered["remove"].isEnabled()


@pytest.mark.function("See that a calibration is old")
def test_an_old_calibration_is_marked(source):
    entry = read_entry(source)
    made = entry.created
    limit = WarningLimits().age_days
    young = cells_of(entry, made + timedelta(days=limit - 1), limit)
    old = cells_of(entry, made + timedelta(days=limit + 1), limit)
    assert young[5].icon == ""
    assert old[5].icon == "stale"
    assert "calibrate again" in old[5].tip


@pytest.mark.parametrize(
    ("sd", "word", "role"),
    [(0.001, "validated", "pass"), (0.05, "not decidable", "warn"), (None, "failed", "fail")],
)
def test_each_result_of_a_validation_has_its_word_and_colour_behind_the_sensor(
    source, tmp_path, sd, word, role
):
    path = Path(shutil.copy(source, tmp_path))
    height = Quantity("height", 1.02 if sd else 1.2, sd, 1.0, 8.0)
    identity = scene.calibration().identity
    write_validation(Validation(identity, "2026-03-01T12:00:00+00:00", "", "x", (height,)), path)
    cells = cells_of(read_entry(path), datetime.now(UTC), 365.0)
    assert TITLES[1:5] == ("Sensor", "Verdict", "Validation", "Name")
    assert (cells[3].text, cells[3].role) == (word, role)


def session_of(context: AppContext, serial: str) -> Path:
    folder = context.workspace.sessions_folder(serial) / "2026-01-02"
    folder.mkdir(parents=True)
    (folder / "session.toml").write_text(f'[sensor]\nserial = "{serial}"\n')
    return folder


@pytest.mark.function(
    "Continue a session that is not finished", "Play a recording from the Sensors page"
)
def test_sessions_are_continued_and_recordings_played_before_there_is_a_calibration(
    page, context, qtbot
):
    folder, path = session_of(context, "S-1"), context.workspace.recording_path("S-1")
    with RecordingWriter(path, RecordingHeader(serial="S-1")) as writer:
        writer.append(np.zeros((24, 32, 3), np.uint8), 0, 1.0)
    page.enter()
    assert "No sensor yet" not in words(page) and "None yet" not in words(page)
    button = page.findChild(QPushButton, "sensors.go_on.button")
    sessions, recordings = (
        page.findChild(QTableView, f"sensors.{name}.table") for name in ("sessions", "recordings")
    )
    assert not button.isEnabled()
    sessions.selectRow(0)
    page.enter()  # the selection is kept
    with qtbot.waitSignal(context.requests.session) as asked:
        button.click()
    assert asked.args == [str(folder)]

    assert [recordings.model().index(0, k).data() for k in range(2)] == ["S-1", path.stem]
    recordings.selectRow(0)
    with qtbot.waitSignal(context.requests.page) as asked:
        page.findChild(QPushButton, "sensors.play.button").click()
    assert asked.args == ["inspect"]
    assert context.source.info is not None and context.source.info.kind == "recording"


@pytest.mark.function("Go from a calibration to the Validation step of its session")
def test_validate_opens_the_session_of_the_calibration_also_outside_the_library(
    page, source, context, tmp_path, qtbot
):
    page.open_path(source)
    chosen = page.chosen()
    folder = tmp_path / "elsewhere" / chosen.summary.session
    folder.mkdir(parents=True)
    (folder / "session.toml").write_text(f'[sensor]\nserial = "{chosen.serial}"\n')
    for recent in (folder, tmp_path / "gone"):
        context.settings.add_recent("sessions", recent)
    page.refresh()
    table = page.findChild(QTableView, "sensors.sessions.table")
    assert table.model().index(0, 1).data() == folder.name and table.model().rowCount() == 1
    with qtbot.waitSignal(context.requests.session) as asked:
        page.offered["validate"].trigger()
    assert asked.args == [str(folder)]
    assert context.workspace.to_validate == chosen.path


@pytest.mark.function("Validate a calibration without its session, with saved measurements")
def test_saved_measurements_validate_a_calibration_without_its_session(
    page, source, context, tmp_path, qtbot
):
    page.open_path(source)
    path = page.chosen().path
    page.offered["validate"].trigger()
    with qtbot.waitSignal(context.requests.page) as asked:
        answer(page, "answer0")
    assert asked.args == ["measure"] and context.workspace.in_use == path
    image = tmp_path / "press.png"
    image.write_bytes(b"a press")
    record = MeasurementRecord(
        page.chosen().serial, page.chosen().summary.identity, "ball",
        (Quantity("diameter_mm", 5.01, 0.01, 5.0, 5.0),), "pass", settings={FILE: str(image)},
    )  # fmt: skip
    context.workspace.records.add(replace(record, verdict="doubtful"))
    page.offered["validate"].trigger()
    assert "1 doubtful" in words(page)
    answer(page, "answer0")
    context.workspace.records.add(record)
    page.offered["validate"].trigger()
    answer(page, "answer0")
    assert read_entry(path).validated and page.chosen().validated


@pytest.mark.function("Rename a calibration")
def test_a_calibration_is_renamed_in_the_list(page, source, context, qtbot):
    page.open_path(source)
    page.offered["use"].trigger()
    content = page.chosen().path.read_bytes()
    assert words(page).count("None yet") == 2, "sessions and recordings say what makes one"
    table = page.findChild(QTableView, "sensors.table")
    assert {page.offered["rename"], page.offered["use"]} <= set(table.actions()), "right click"
    page.offered["rename"].trigger()
    line = table.findChild(QLineEdit)
    qtbot.keyClicks(line, "new gel")
    qtbot.keyClick(line, Qt.Key.Key_Return)
    qtbot.waitUntil(lambda: page.chosen().name == "new_gel")
    assert context.workspace.in_use == page.chosen().path
    assert page.chosen().path.read_bytes() == content


@pytest.mark.function("Save a copy of a calibration file")
def test_a_copy_of_a_calibration_is_saved(page, source, tmp_path, monkeypatch):
    copy = tmp_path / "copy.gplcal"
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(copy), ""))
    page.open_path(source)
    page.offered["copy"].trigger()
    assert copy.read_bytes() == page.chosen().path.read_bytes()


@pytest.mark.function("Write a calibration's report, as PDF")
def test_a_report_is_written_in_the_background(page, source, context, tmp_path, qtbot, monkeypatch):
    place, nowhere = tmp_path / "report.pdf", tmp_path / "nowhere" / "report.pdf"
    places = iter((place, nowhere))
    monkeypatch.setattr(QFileDialog, "getSaveFileName", lambda *_: (str(next(places)), ""))
    page.open_path(source)
    bar = page.findChild(QProgressBar, "sensors.busy")
    page.offered["report"].trigger()
    assert bar.isVisible()
    assert not page.offered["report"].isEnabled()
    qtbot.waitUntil(lambda: page.offered["report"].isEnabled())
    assert not bar.isVisible()
    assert place.stat().st_size > 1000
    assert str(place) in context.toasts.shown()[-1].text
    page.offered["report"].trigger()
    qtbot.waitUntil(lambda: page.offered["report"].isEnabled())
    failed = context.toasts.shown()[-1]
    assert str(nowhere.parent) in failed.text and failed.finding.verdict == "fail"
