"""What a technician does on the Measure page: measure, correct, compare, keep, find it again."""

from __future__ import annotations

import csv
import json
import shutil
import sqlite3
import threading
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import cv2
import numpy as np
import pytest
from PySide6.QtCore import QMimeData, QPointF, Qt, QUrl
from PySide6.QtGui import QAction, QDropEvent
from pytestqt.qtbot import QtBot

from app.command_line.main import main
from app.measure.grips import grips_of
from app.measure.judging import Stated
from app.measure.page import MeasurePage
from app.shell.context import AppContext
from app.shell.settings import Limits
from gelpolight_core.calibration.calibration import Calibration
from gelpolight_core.calibration.file import read_calibration, write_calibration
from gelpolight_core.measurement.tools import ProfileWidth
from gelpolight_core.recording.recording import RecordingHeader
from gelpolight_core.recording.writer import RecordingWriter
from gelpolight_core.records.entry import MeasurementRecord, Quantity
from gelpolight_core.records.records import NAME, Records

PATIENCE_MS = 60_000


@pytest.fixture(scope="module")
def calibration_file(
    small_calibration: Calibration, tmp_path_factory: pytest.TempPathFactory
) -> Path:
    """Return the small sensor's calibration as a file."""
    path = tmp_path_factory.mktemp("calibration") / "small.gplcal"
    write_calibration(small_calibration, path)
    return path


@pytest.fixture
def press(small_session: Path) -> Path:
    """Return the picture of a cylinder."""
    return next(iter(sorted((small_session / "presses").glob("cylinder*.png"))))


@pytest.fixture
def library(context: AppContext, calibration_file: Path) -> Path:
    """Put the calibration into the workspace and into use."""
    path = context.workspace.import_calibration(calibration_file)
    context.workspace.use(path)
    return path


@pytest.fixture
def page(context: AppContext, qtbot: QtBot) -> Iterator[MeasurePage]:
    """Return the page, shown."""
    made = _open(context)
    yield made
    _close(made)


def _open(context: AppContext) -> MeasurePage:
    page = MeasurePage(context=context)
    page.resize(1180, 740)
    page.show()
    page.enter()
    return page


def _close(page: MeasurePage) -> None:
    page.leave()
    page.may_close()
    page.close()
    page.deleteLater()


def _measured(page: MeasurePage, qtbot: QtBot) -> None:
    work = page.desk.work
    qtbot.waitUntil(lambda: work.result is not None and not work.busy, timeout=PATIENCE_MS)


def _put_cylinder(page: MeasurePage, press: Path, qtbot: QtBot) -> None:
    page.open_path(press)
    qtbot.waitUntil(lambda: page.desk.work.heightmap is not None, timeout=PATIENCE_MS)
    page.desk.propose()
    _measured(page, qtbot)


def _kept(page: MeasurePage, qtbot: QtBot, count: int) -> None:
    qtbot.waitUntil(lambda: len(page.book.records) == count and not page.book.busy)


def test_without_a_calibration_the_page_says_what_to_do(page: MeasurePage) -> None:
    assert "calibration" in page.desk.banner.findChild(object, "inspect.advice").text()
    assert not page.desk.map.tools.buttons["distance"].isEnabled()
    assert not page.desk.panel.keep.isEnabled()
    assert page.results.stack.currentIndex() == 0


def test_damaged_records_are_kept_aside_and_it_is_said(context: AppContext, qtbot: QtBot) -> None:
    context.workspace.folder.mkdir(parents=True)
    (context.workspace.folder / "records.sqlite").write_bytes(b"no database at all" * 100)
    page = _open(context)
    told: list[str] = []
    page.book.noticed.connect(told.append)
    qtbot.waitUntil(lambda: bool(told))
    assert "damaged" in told[0]
    assert len(list(context.workspace.folder.glob("records.damaged-*"))) == 1
    _close(page)
    context.toasts.clear()


@pytest.mark.usefixtures("library")
def test_a_press_is_recognised_measured_compared_and_kept_like_the_command_says(
    page: MeasurePage,
    context: AppContext,
    qtbot: QtBot,
    press: Path,
    tmp_path: Path,
    calibration_file: Path,
) -> None:
    _put_cylinder(page, press, qtbot)
    desk = page.desk
    assert desk.work.tool.name == "cylinder"
    true = _true(press)
    desk.panel.truth.state(Stated(float(true["diameter_mm"]), float(true["height_mm"])))
    desk.panel.who.setText("Ada")
    desk.panel.note.setText("on the bench")
    desk.keep()
    _kept(page, qtbot, 1)

    at = desk.work.tool.at_mm
    result = tmp_path / "result.json"
    arguments = ["measure", str(calibration_file), str(press), "--shape", "cylinder"]
    arguments += ["--truth", str(press.parent / "truth.csv"), "--json", str(result)]
    assert main([*arguments, "--seed", repr(at[0]), repr(at[1])]) == 0
    told = json.loads(result.read_text())
    (record,) = page.book.records
    assert {k: record.details[k] for k in told} == told
    assert [q.value for q in record.quantities] == [told["diameter_mm"], told["height_mm"]]
    assert [q.error_percent for q in record.quantities] == list(told["error_percent"].values())
    assert (record.operator, record.note, record.picture) == ("Ada", "on the bench", press.name)

    with closing(sqlite3.connect(context.workspace.folder / NAME)) as records:
        calibrations = records.execute("SELECT id, model, made, verdict FROM calibrations")
        (known,) = calibrations.fetchall()
    used = read_calibration(calibration_file)
    assert known == (used.identity, "full", used.provenance.created, used.verdict.value)

    # The limits are the person's: remembered, and followed at once.
    page._keep_limits(Limits(size_percent=0.001))
    assert "beyond" in desk.panel.truth.verdict.text()
    assert context.settings.limits.size_percent == 0.001

    again = _open(context)
    _kept(again, qtbot, 1)
    assert again.tabs.tabText(1) == "Records (1)"
    _close(again)


def _true(press: Path) -> dict[str, str]:
    with (press.parent / "truth.csv").open(newline="") as stream:
        return next(row for row in csv.DictReader(stream) if row["file"] == press.name)


@pytest.mark.usefixtures("library")
def test_tools_are_placed_moved_by_keys_and_taken_back(
    page: MeasurePage, qtbot: QtBot, press: Path
) -> None:
    page.open_path(press)
    work, tool_map = page.desk.work, page.desk.map
    qtbot.waitUntil(lambda: work.heightmap is not None, timeout=PATIENCE_MS)
    tool_map.tools.buttons["distance"].click()
    tool_map.layer.clicked.emit(-2.0, 0.0)
    tool_map.layer.clicked.emit(2.0, 0.0)
    _measured(page, qtbot)
    assert work.result.figures[0].value == pytest.approx(4.0)

    # Three nudges of one end are one step of the history.
    tool_map._next_grip(1)
    for _ in range(3):
        qtbot.keyClick(tool_map, Qt.Key.Key_Right, Qt.KeyboardModifier.ShiftModifier)
    _measured(page, qtbot)
    assert work.result.figures[0].value == pytest.approx(4.6)
    work.undo.undo()
    _measured(page, qtbot)
    assert work.result.figures[0].value == pytest.approx(4.0)
    work.undo.redo()
    assert grips_of(work.tool)[1].at_mm == pytest.approx((2.6, 0.0))

    tool_map.layer.dragged.emit("a", -1.0, 0.0)
    tool_map.layer.dropped.emit("a", -1.4, 0.0)
    _measured(page, qtbot)
    assert work.result.figures[0].value == pytest.approx(4.0)
    qtbot.keyClick(tool_map, Qt.Key.Key_Delete)
    assert work.sheet.items == ()
    work.undo.undo()
    assert len(work.sheet.items) == 1

    # By keys alone: choose, place in the middle, let another one go.
    tool_map.tools.buttons["rectangle"].click()
    qtbot.keyClick(tool_map, Qt.Key.Key_Return)
    assert [item.tool.name for item in work.sheet.items] == ["distance", "rectangle"]
    tool_map.tools.buttons["angle"].click()
    qtbot.keyClick(tool_map, Qt.Key.Key_Escape)
    assert not any(b.isChecked() for b in tool_map.tools.buttons.values())
    _measured(page, qtbot)


@pytest.mark.usefixtures("library")
def test_what_is_removed_from_the_records_comes_back_by_undo_and_goes_out_as_csv(
    page: MeasurePage, qtbot: QtBot, press: Path, tmp_path: Path
) -> None:
    _put_cylinder(page, press, qtbot)
    for count in (1, 2):
        page.desk.keep()
        _kept(page, qtbot, count)
    results = page.results
    page.tabs.setCurrentWidget(results)
    assert "2 x" in results.statistics.text()
    results.table.selectRow(0)
    results.remove_selected()
    _kept(page, qtbot, 1)
    page.book.undo.undo()
    _kept(page, qtbot, 2)
    number = page.book.records[0].id
    page.book.write_note(number, "worn tip")
    qtbot.waitUntil(lambda: page.book.records[0].note == "worn tip")
    page.book.undo.undo()
    qtbot.waitUntil(lambda: page.book.records[0].note == "")
    table = tmp_path / "out.csv"
    results.export_to(table)
    qtbot.waitUntil(lambda: table.exists() and not page.book.busy)
    with table.open(newline="", encoding="utf-8-sig") as stream:
        rows = list(csv.DictReader(stream))
    assert {row["quantity"] for row in rows} == {"diameter_mm", "height_mm"}
    assert len(rows) == 4
    page.context.toasts.clear()


@pytest.mark.usefixtures("library")
def test_a_picture_of_another_size_is_refused_by_a_sentence_and_the_next_one_is_taken(
    page: MeasurePage, qtbot: QtBot, press: Path, tmp_path: Path
) -> None:
    wrong = tmp_path / "other.png"
    rgb = np.random.default_rng(0).integers(0, 255, (48, 64, 3), np.uint8)
    cv2.imwrite(str(wrong), rgb)
    page.open_path(wrong)
    advice = page.desk.banner.findChild(object, "inspect.advice")
    qtbot.waitUntil(lambda: "64x48" in advice.text(), timeout=PATIENCE_MS)
    assert not page.desk.panel.keep.isEnabled()

    dropped = QMimeData()
    dropped.setUrls([QUrl.fromLocalFile(str(press))])
    page.dropEvent(
        QDropEvent(
            QPointF(5, 5),
            Qt.DropAction.CopyAction,
            dropped,
            Qt.MouseButton.LeftButton,
            Qt.KeyboardModifier.NoModifier,
        )
    )
    qtbot.waitUntil(lambda: page.desk.work.heightmap is not None, timeout=PATIENCE_MS)
    assert "64x48" not in advice.text()


@pytest.mark.usefixtures("library")
def test_a_steady_press_before_the_camera_is_held_and_recognised_by_itself(
    page: MeasurePage, context: AppContext, qtbot: QtBot, press: Path, tmp_path: Path
) -> None:
    from app.sources.listing import picture_folders

    folder = tmp_path / "camera"
    folder.mkdir()
    shutil.copy(press, folder / press.name)
    for info in picture_folders([folder])():
        context.source.choose(info)
    _measured(page, qtbot)
    desk = page.desk
    assert desk.hold_action.isChecked()
    assert desk.work.tool.name == "cylinder"
    held = desk.work.result.measurement.as_json()

    # It is the very picture: from its file the figures are the same to the last bit.
    desk.open_file(press)
    desk.propose()
    _measured(page, qtbot)
    assert desk.work.result.measurement.as_json() == held

    desk.hold_action.trigger()
    assert desk.work.taken is None
    assert not desk.panel.keep.isEnabled()


@pytest.mark.usefixtures("library")
def test_a_section_is_shown_where_its_width_was_read_and_the_tools_in_the_other_views(
    page: MeasurePage, qtbot: QtBot, press: Path
) -> None:
    page.open_path(press)
    desk = page.desk
    qtbot.waitUntil(lambda: desk.work.heightmap is not None, timeout=PATIENCE_MS)
    desk.details.open_at(desk.details.section)
    depth = desk.work.heightmap
    row, column = np.unravel_index(depth.depth_mm.argmax(), depth.depth_mm.shape)
    x, y = float(depth.x_mm[column]), float(depth.y_mm[row])
    desk.work.add(ProfileWidth((x - 6.0, y), (x + 6.0, y)))
    _measured(page, qtbot)
    assert desk.details.section.currentWidget() is desk.details.plot
    assert not desk.map.panel.grab().isNull() and not desk.details.plot.grab().isNull()

    desk.details.open_at(desk.details.camera)
    assert desk.details.camera.picture_size == (320, 240)
    desk.details.open_at(desk.details.surface)
    qtbot.waitUntil(lambda: desk.details.surface.view is not None, timeout=PATIENCE_MS)
    view = desk.details.surface.view
    qtbot.waitUntil(lambda: view.drawings > 0, timeout=PATIENCE_MS)
    desk.details.open_at(desk.details.surface, False)
    assert not desk.details.wants_surface


@pytest.mark.usefixtures("library")
def test_a_recording_is_gone_through_frame_by_frame(
    page: MeasurePage, qtbot: QtBot, press: Path, tmp_path: Path
) -> None:
    rgb = np.ascontiguousarray(cv2.imread(str(press))[..., ::-1])
    path = tmp_path / "press.gplrec"
    with RecordingWriter(path, RecordingHeader(serial="virtual-1")) as writer:
        for number in range(4):
            writer.append(rgb, number, 100.0 + 0.05 * number)
    page.desk.auto.setChecked(False)
    page.open_path(path)
    desk = page.desk
    qtbot.waitUntil(lambda: desk.replay.isVisible(), timeout=PATIENCE_MS)
    qtbot.waitUntil(lambda: desk.hold_action.isEnabled(), timeout=PATIENCE_MS)
    desk.hold()
    assert desk.work.taken is not None
    desk.replay.findChild(QAction, "replay.on").trigger()
    assert desk.work.taken is None
    qtbot.waitUntil(lambda: desk.hold_action.isEnabled(), timeout=PATIENCE_MS)


def test_another_workspace_is_read_at_once_and_what_was_meant_for_the_first_is_refused(
    page: MeasurePage, context: AppContext, qtbot: QtBot, tmp_path: Path
) -> None:
    book, go = page.book, threading.Event()
    record = MeasurementRecord("A-1", "", "distance", (Quantity("distance_mm", 9.0),))
    book.add(record, lambda _number: None)
    _kept(page, qtbot, 1)
    book.remove((book.records[0].id,))
    _kept(page, qtbot, 0)
    refused: list[str] = []
    book.refused.connect(refused.append)
    waiting = threading.Event()

    def wait(_records: Records) -> None:
        waiting.set()
        go.wait(20.0)

    book.change("Waiting", wait)
    assert waiting.wait(20.0)
    book.add(record, lambda _number: None)
    context.workspace.folder = tmp_path / "other"
    context.requests.calibrations_changed.emit()
    assert not book.undo.canUndo()
    go.set()
    qtbot.waitUntil(lambda: not book.busy)
    assert "another workspace was chosen meanwhile" in refused[0]
    assert book.records == ()
    assert not (tmp_path / "other" / NAME).exists()
    context.toasts.clear()
