"""The work of a technician on the Measure page: measure, correct, compare, save, find again."""

import csv
import json
import shutil
import threading
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pyqtgraph as pg
import pytest
from PySide6.QtCore import QEvent, QLocale, QMimeData, QPoint, QPointF, Qt, QUrl
from PySide6.QtGui import QAction, QDropEvent
from PySide6.QtWidgets import QFileDialog
from pytestqt.qtbot import QtBot
from report_pdf import report_data

from app.cli.main import main
from app.live.tool_layer import tool_handles
from app.measure.page import MeasurePage
from app.measure.press_view import PressView
from app.measure.record_table import TITLES
from app.program.context import AppContext
from app.program.preferences import WarningLimits, settings_file
from app.sources.source import SourceFrame
from gelpolight_core.base.compared_quantity import Quantity
from gelpolight_core.base.csv_table import read_csv
from gelpolight_core.base.store import Store
from gelpolight_core.calibration.calibration_file import write_calibration
from gelpolight_core.lab.measurement_record import MeasurementRecord
from gelpolight_core.lab.measurement_store import NAME
from gelpolight_core.measurement.tools.point_tools import DistanceTool
from gelpolight_core.measurement.tools.tool_registry import tool_as_dict
from gelpolight_core.output.recording.recording_format import RecordingHeader
from gelpolight_core.output.recording.recording_writer import RecordingWriter
from gelpolight_core.session.reference_object import ReferenceObject
from tests.app import mouse

PATIENCE_MS = 300_000


@pytest.fixture(scope="module")
def calibration_file(small_calibration, tmp_path_factory):
    """Return the small sensor's calibration as a file."""
    path = tmp_path_factory.mktemp("calibration") / "small.gplcal"
    write_calibration(small_calibration, path)
    return path


@pytest.fixture
def press(small_session):
    """Return the image of a cylinder."""
    return next(iter(sorted((small_session / "presses").glob("cylinder*.png"))))


@pytest.fixture
def library(context, calibration_file):
    """Put the calibration into the workspace and select it."""
    path = context.workspace.import_calibration(calibration_file)
    context.workspace.use(path)
    return path


@pytest.fixture
def page(context, qtbot):
    """Return the visible page."""
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
    page.can_close()
    page.close()
    page.deleteLater()


def _measured(page: MeasurePage, qtbot: QtBot) -> None:
    work = page.press_view.work
    qtbot.waitUntil(lambda: work.result is not None and not work.busy, timeout=PATIENCE_MS)


def _put_cylinder(page: MeasurePage, press: Path, qtbot: QtBot) -> None:
    page.open_path(press)
    qtbot.waitUntil(lambda: page.press_view.work.heightmap is not None, timeout=PATIENCE_MS)
    page.press_view.propose()
    _measured(page, qtbot)


def _kept(page: MeasurePage, qtbot: QtBot, count: int) -> None:
    qtbot.waitUntil(lambda: len(page.book.records) == count and not page.book.busy)


def test_damaged_records_are_reported(context, qtbot):
    context.workspace.folder.mkdir(parents=True)
    (context.workspace.folder / "records.sqlite").write_bytes(b"no database at all" * 100)
    page = _open(context)
    reported: list[str] = []
    page.book.noticed.connect(reported.append)
    qtbot.waitUntil(lambda: bool(reported))
    assert "damaged" in reported[0]
    # Without a calibration the page shows what to do.
    assert "calibration" in page.press_view.banner.findChild(object, "inspect.advice").text()
    assert not page.press_view.palette_.buttons["distance"].isEnabled()
    assert not page.press_view.save_action.isEnabled()
    assert page.press_view.inspector.image.text() == "", "there is nothing to freeze"
    assert page.results.stack.currentIndex() == 0
    _close(page)
    context.toasts.clear()


@pytest.mark.function("Detect, measure, compare and save a pressed object, as the command does")
@pytest.mark.usefixtures("library")
def test_a_press_is_detected_measured_compared_and_saved_like_the_command_does(
    page, context, qtbot, press, tmp_path, calibration_file, monkeypatch
):
    _put_cylinder(page, press, qtbot)
    press_view = page.press_view
    assert press_view.work.tool.name == "cylinder"
    true = _true(press)
    press_view.inspector.reference.state(
        ReferenceObject(size_mm=float(true["diameter_mm"]), height_mm=float(true["height_mm"]))
    )
    press_view.inspector.remarks.change(operator="Ada", note="on the bench")
    press_view.keep()
    _kept(page, qtbot, 1)

    at = press_view.work.tool.at_mm
    result = tmp_path / "result.json"
    arguments = ["measure", str(calibration_file), str(press), "--shape", "cylinder"]
    arguments += ["--truth", str(press.parent / "truth.csv"), "--json", str(result)]
    assert main([*arguments, "--at", repr(at[0]), repr(at[1])]) == 0
    reported = json.loads(result.read_text())
    assert reported.pop("faults") == []
    (record,) = page.book.records
    assert {k: record.details[k] for k in reported} == reported
    assert [q.value for q in record.quantities] == [reported["diameter_mm"], reported["height_mm"]]
    assert [q.error_percent for q in record.quantities] == list(reported["error_percent"].values())
    assert (record.operator, record.note, record.picture) == ("Ada", "on the bench", press.name)

    certificate = tmp_path / "measurement.pdf"
    certify = press_view.certify_action
    assert certify in page.export_actions() and certify.isEnabled()
    page.tabs.setCurrentWidget(page.results)  # that of a record is made from its image
    assert certify in page.export_actions() and not certify.isEnabled()
    assert "image first" in certify.toolTip()
    page.tabs.setCurrentWidget(press_view)
    assert press.stem in _name_of(press_view, monkeypatch)
    press_view.certify(certificate)
    qtbot.waitUntil(certificate.exists, timeout=PATIENCE_MS)
    (certified,) = report_data(certificate)["data"]["measurements"]
    assert {key: certified[key] for key in reported} == reported
    heads, *_, expanded = press_view.state.budget
    assert heads[1:] == ("diameter", "height")
    for text, row in zip(expanded[1:], certified["comparisons"], strict=True):
        assert float(text) == pytest.approx(row["deviation_expanded"], abs=0.001)

    # Other limits of the user apply at once.
    assert press_view.state.rows[0].decision.startswith("not decidable")  # known to 7 %
    context.settings.limits = WarningLimits(size_percent=20.0)
    context.requests.preferences_changed.emit()
    assert press_view.state.rows[0].decision.startswith("conforms")
    assert press_view.state.rows[0].role == press_view.state.verdict_role == "warn"  # doubtful
    # The command judges by the same tolerances.
    assert reported["comparisons"][0]["decision"] == "not decidable"
    context.settings.save()
    settings_file().parent.mkdir()
    shutil.copy(context.settings.path, settings_file())
    assert main([*arguments, "--at", repr(at[0]), repr(at[1])]) == 0
    by_command = json.loads(result.read_text())["comparisons"]
    assert [row["decision"] for row in by_command] == ["conforms", record.quantities[1].decision]
    assert [row["tolerance_percent"] for row in by_command] == [20.0, 8.0]

    again = _open(context)
    _kept(again, qtbot, 1)
    assert again.tabs.tabText(1) == "Records (1)"
    _close(again)


@pytest.mark.function(
    "State the edge radius of an object in the window",
    "List all measurements, delete some and restore them, export CSV",
    "Open the image of a record again with a double click",
)
@pytest.mark.usefixtures("library")
def test_the_fit_uses_a_stated_edge_radius_and_records_are_removed_and_exported(
    page, qtbot, press, tmp_path
):
    _put_cylinder(page, press, qtbot)
    work, reference = page.press_view.work, page.press_view.inspector.reference
    fitted = work.result.measurement
    reference.state(
        ReferenceObject(
            size_mm=4.0,
            edge_radius_mm=0.3,
            edge_radius_expanded_mm=0.02,
            certificate="K-2041",
            due="2020-01-01",
        )
    )
    _measured(page, qtbot)
    assert (work.tool.edge_radius_mm, work.tool.edge_radius_sd_mm) == (0.3, 0.01)
    assert work.result.measurement.edge_radius_mm == pytest.approx(0.3, abs=0.03)
    assert work.result.measurement.diameter_mm > fitted.diameter_mm + 0.01
    assert "K-2041" in page.press_view.state.reason, "its calibration has ended"
    reference.state(ReferenceObject())
    _measured(page, qtbot)
    assert work.result.measurement.diameter_mm == pytest.approx(fitted.diameter_mm)

    for count, expanded_mm in enumerate((0.0, 0.01), 1):
        reference.state(ReferenceObject(size_mm=4.0, size_expanded_mm=expanded_mm))
        assert page.press_view.save_action.isEnabled()
        page.press_view.keep()
        page.press_view.keep()  # a second time changes nothing
        _kept(page, qtbot, count)
        assert not page.press_view.save_action.isEnabled()
    results = page.results
    assert page.history is page.press_view.work.undo
    page.tabs.setCurrentWidget(results)
    assert page.history is page.book.undo
    assert "2 x" in results.statistics.text()
    toasts = page.context.toasts
    toasts.attach(page, lambda: None)
    results.table.selectRow(0)
    results.remove_selected()
    _kept(page, qtbot, 1)
    assert [toast.text for toast in toasts.shown()] == ["Measurements removed: 1"]
    page.book.undo.undo()
    assert toasts.shown() == []
    _kept(page, qtbot, 2)
    page.book.write_note(page.book.records[0], "worn tip")
    qtbot.waitUntil(lambda: page.book.records[0].note == "worn tip")
    page.book.undo.undo()
    qtbot.waitUntil(lambda: page.book.records[0].note == "")
    for chosen in ({1, 2}, {2}):
        table = tmp_path / f"{len(chosen)}.csv"
        results.table.clearSelection()
        if len(chosen) == 1:
            results.table.choose(*chosen)
        results.export_to(table)
        qtbot.waitUntil(lambda path=table: path.exists() and not page.book.busy)
        with table.open(newline="", encoding="utf-8-sig") as stream:
            rows = list(csv.DictReader(stream))
        assert {row["quantity"] for row in rows} == {"diameter_mm", "height_mm"}
        assert {int(row["id"]) for row in rows} == chosen

    # A double click measures on the image again, as long as it is there.
    page.press_view.release()
    assert not page.export_actions()[0].isEnabled()
    results.table.doubleClicked.emit(results.table.model().index(0, 0))
    assert page.tabs.currentWidget() is page.press_view
    assert page.press_view.work.image.path == press
    other = (Quantity("distance_mm", 1.0),)
    gone = replace(page.book.records[0], quantities=other, settings={"file": "gone.png"})
    page.book.add(gone, int)
    _kept(page, qtbot, 3)
    page.press_view.release()
    results.table.choose(3)
    results.table.doubleClicked.emit(results.table.model().index(0, 0))
    assert "gone.png" in results.message.text() and page.press_view.work.image is None
    toasts.clear()


def _name_of(view: PressView, monkeypatch: pytest.MonkeyPatch) -> str:
    """Return the file name that is offered for the certificate."""
    asked = []
    monkeypatch.setattr(
        QFileDialog, "getSaveFileName", lambda *args: asked.append(args) or ("", "")
    )
    view.choose_certificate()
    return str(asked[0])


def _true(press: Path) -> dict[str, str]:
    with (press.parent / "truth.csv").open(newline="") as stream:
        return next(row for row in csv.DictReader(stream) if row["file"] == press.name)


@pytest.mark.function(
    "Place tools by clicks or by drawing a line, on a map that stays where it is",
    "Move placed tools by mouse or keys, and undo it",
)
@pytest.mark.usefixtures("library")
def test_tools_are_placed_moved_by_keys_and_undone(page, qtbot, press):
    page.open_path(press)
    work, tool_map = page.press_view.work, page.press_view.map
    qtbot.waitUntil(lambda: work.heightmap is not None, timeout=PATIENCE_MS)
    qtbot.waitUntil(lambda: tool_map.map.has_image)
    qtbot.wait(50)
    px_mm = 2.0 * abs(tool_map.layer.pixelLength(pg.Point(1.0, 0.0)))
    view, left = tool_map.map.viewport(), Qt.MouseButton.LeftButton

    def at(x_mm: float, y_mm: float) -> QPoint:
        return tool_map.map.mapFromScene(tool_map.map.box.mapViewToScene(QPointF(x_mm, y_mm)))

    # Two clicks: whatever the page says meanwhile, the map stays where it is.
    page.press_view.palette_.buttons["step-height"].click()
    place = view.mapToGlobal(at(0.0, 0.0))
    for point in (at(-2.0, 1.0), at(2.0, 1.0)):
        mouse.send(view, QEvent.Type.MouseMove, QPointF(point))
        qtbot.mouseClick(view, left, pos=point)
        tool_map.hint.setText(200 * "w")
        qtbot.wait(1)
        assert view.mapToGlobal(at(0.0, 0.0)) == place
    assert work.tool.first.centre_mm == pytest.approx((-2.0, 1.0), abs=px_mm)
    assert work.tool.second.centre_mm == pytest.approx((2.0, 1.0), abs=px_mm)
    work.remove()

    # A line that is drawn.
    page.press_view.palette_.buttons["distance"].click()
    mouse.drag(view, QPointF(at(-2.0, 0.0)), QPointF(at(2.0, 0.0)))
    assert view.mapToGlobal(at(0.0, 0.0)) == place
    assert work.tool.a_mm == pytest.approx((-2.0, 0.0), abs=px_mm)
    assert work.tool.b_mm == pytest.approx((2.0, 0.0), abs=px_mm)
    work.remove()

    page.press_view.palette_.buttons["distance"].click()
    tool_map.on_point((-2.0, 0.0))
    tool_map.on_point((2.0, 0.0))
    _measured(page, qtbot)
    assert work.result.figures[0].value == pytest.approx(4.0)

    # Three key moves of one end are one undo step.
    tool_map.choose_next_grip(1)
    for _ in range(3):
        qtbot.keyClick(tool_map, Qt.Key.Key_Right, Qt.KeyboardModifier.ShiftModifier)
    _measured(page, qtbot)
    assert work.result.figures[0].value == pytest.approx(4.6)
    work.undo.undo()
    _measured(page, qtbot)
    assert work.result.figures[0].value == pytest.approx(4.0)
    work.undo.redo()
    assert tool_handles(work.tool)[1].at == pytest.approx((2.6, 0.0))

    tool_map.on_drag("a", (-1.0, 0.0), ended=False)
    tool_map.on_drag("a", (-1.4, 0.0), ended=True)
    _measured(page, qtbot)
    assert work.result.figures[0].value == pytest.approx(4.0)
    qtbot.keyClick(tool_map, Qt.Key.Key_Delete)
    assert work.sheet == {}
    work.undo.undo()
    assert len(work.sheet) == 1

    # A tool of three points is saved with its quantity and its places.
    page.press_view.palette_.buttons["angle"].click()
    for point in ((2.0, 0.0), (0.0, 0.0), (2.0, 2.0)):
        tool_map.on_point(point)
    _measured(page, qtbot)
    page.press_view.keep()
    _kept(page, qtbot, 1)
    (record,) = page.book.records
    first = record.quantities[0]
    assert (first.name, first.value) == ("angle_deg", pytest.approx(45.0))
    assert first.sd is not None and first.sd > 0.0
    assert record.settings["tool"] == tool_as_dict(work.tool)
    work.remove()

    # With the keyboard only: choose a tool, place it in the middle, cancel another one.
    page.press_view.palette_.buttons["rectangle"].click()
    qtbot.keyClick(tool_map, Qt.Key.Key_Return)
    assert [tool.name for tool in work.sheet.values()] == ["distance", "rectangle"]
    page.press_view.palette_.buttons["angle"].click()
    qtbot.keyClick(tool_map, Qt.Key.Key_Escape)
    assert not any(b.isChecked() for b in page.press_view.palette_.buttons.values())
    _measured(page, qtbot)

    # Without a calibration nothing of the last one stays on the map.
    assert tool_map.layer.tools[0].text
    page.context.workspace.use(None)
    page.context.requests.calibrations_changed.emit()
    assert not any(tool.text for tool in tool_map.layer.tools)
    assert not tool_map.map.has_image


@pytest.mark.usefixtures("library")
def test_an_image_of_another_size_is_refused_and_the_next_one_is_accepted(
    page, qtbot, press, tmp_path
):
    wrong = tmp_path / "other.png"
    rgb = np.random.default_rng(0).integers(0, 255, (48, 64, 3), np.uint8)
    cv2.imwrite(str(wrong), rgb)
    page.open_path(wrong)
    advice = page.press_view.banner.findChild(object, "inspect.advice")
    qtbot.waitUntil(lambda: "64x48" in advice.text(), timeout=PATIENCE_MS)
    assert advice.text().startswith(wrong.name)
    assert not page.press_view.inspector.reason.text()  # the banner says it
    assert page.press_view.map.hint.text() == ""
    work, message = page.press_view.work, page.press_view.inspector.message
    work.answer = "Nothing was found"
    work.changed.emit()
    assert work.answer in message.text()
    assert not page.press_view.save_action.isEnabled()

    dropped = QMimeData()
    dropped.setUrls([QUrl.fromLocalFile(str(press))])
    left, none = Qt.MouseButton.LeftButton, Qt.KeyboardModifier.NoModifier
    page.dropEvent(QDropEvent(QPointF(5, 5), Qt.DropAction.CopyAction, dropped, left, none))
    qtbot.waitUntil(lambda: page.press_view.work.heightmap is not None, timeout=PATIENCE_MS)
    assert "64x48" not in advice.text()
    assert message.isHidden()


@pytest.mark.function(
    "Freeze and detect a steady press automatically",
    "Press one object after the other: Measure follows, and never measures an earlier one unsaid",
)
@pytest.mark.usefixtures("library")
def test_a_steady_press_is_frozen_and_the_next_is_followed_or_reported_as_another(
    page, context, qtbot, press, tmp_path
):
    press_view, work = page.press_view, page.press_view.work
    folders = {}
    for shown in (press, next(press.parent.glob("cuboid*.png"))):
        kind = shown.name.partition("_")[0]
        folders[kind] = tmp_path / kind
        folders[kind].mkdir()
        shutil.copy(shown, folders[kind])
    context.source.choose_folder(folders["cylinder"])
    _measured(page, qtbot)
    assert press_view.state.frozen
    assert work.tool.name == "cylinder"
    first = work.image
    context.source.choose_folder(folders["cuboid"])
    qtbot.waitUntil(lambda: work.image is not first, timeout=PATIENCE_MS)
    _measured(page, qtbot)
    assert work.tool.name == "cuboid"

    # A tool placed by hand is not lost: the image stays, and the page says that it is earlier.
    work.add(DistanceTool((-2.0, 0.0), (2.0, 0.0)))
    _measured(page, qtbot)
    second = work.image
    context.source.choose_folder(folders["cylinder"])
    qtbot.waitUntil(lambda: press_view.state.earlier, timeout=PATIENCE_MS)
    assert work.image is second
    assert "earlier" in press_view.save_action.text()
    assert "earlier" in press_view.banner.findChild(object, "inspect.advice").text()
    press_view.detect_action.trigger()
    assert work.image is not second and not press_view.state.earlier
    _measured(page, qtbot)
    assert [tool.name for tool in work.sheet.values()] == ["cylinder"]
    held = work.result.measurement.as_json()
    # It is the same image: from its file the figures are identical to the last bit.
    press_view.open_file(folders["cylinder"] / press.name)
    press_view.propose()
    _measured(page, qtbot)
    assert work.result.measurement.as_json() == held
    press_view.freeze_action.trigger()
    assert work.image is None
    assert not press_view.save_action.isEnabled()


@pytest.mark.function("Measure the presses of a folder one after the other")
@pytest.mark.usefixtures("library")
def test_the_next_object_is_the_next_file_and_an_unsaved_one_is_asked_for(page, qtbot, press):
    press_view, files = page.press_view, sorted(press.parent.glob("*.png"))
    assert page.unfinished() == ""
    _put_cylinder(page, press, qtbot)
    assert "not saved" in page.unfinished()
    press_view.save_action.trigger()
    _kept(page, qtbot, 1)
    assert page.unfinished() == ""
    press_view.freeze_action.trigger()
    assert press_view.work.image.path == files[files.index(press) + 1]
    press_view.open_file(files[-1])
    press_view.freeze_action.trigger()
    assert press_view.work.image is None


@pytest.mark.function("Measure a recording frame by frame")
@pytest.mark.usefixtures("library")
def test_a_recording_can_be_measured_frame_by_frame(
    page, context, qtbot, press, small_calibration, tmp_path
):
    rgb = np.ascontiguousarray(cv2.imread(str(press))[..., ::-1])
    path = tmp_path / "press.gplrec"
    with RecordingWriter(path, RecordingHeader(serial="virtual-1")) as writer:
        for number in range(4):
            writer.append(rgb, number, 100.0 + 0.05 * number)
    page.press_view.inspector.auto.setChecked(False)
    page.open_path(path)
    press_view = page.press_view
    qtbot.waitUntil(lambda: press_view.replay.isVisible(), timeout=PATIENCE_MS)
    qtbot.waitUntil(lambda: press_view.freeze_action.isEnabled(), timeout=PATIENCE_MS)
    press_view.freeze()
    assert press_view.work.image is not None
    press_view.replay.findChild(QAction, "replay.on").trigger()
    assert press_view.work.image is None
    qtbot.waitUntil(lambda: press_view.freeze_action.isEnabled(), timeout=PATIENCE_MS)

    # A frozen frame is not measured with another sensor's calibration.
    press_view.freeze()
    qtbot.waitUntil(lambda: press_view.work.heightmap is not None, timeout=PATIENCE_MS)
    press_view.work.add(DistanceTool((0.0, 0.0), (1.0, 0.0)))
    assert press_view.map.layer.tools and press_view.map.hint.text()
    other = small_calibration.changed(sensor=replace(small_calibration.data.sensor, serial="B-2"))
    write_calibration(other, tmp_path / "other.gplcal")
    context.workspace.use(context.workspace.import_calibration(tmp_path / "other.gplcal"))
    context.requests.calibrations_changed.emit()
    qtbot.waitUntil(lambda: "sensor virtual-1" in press_view.work.refused, timeout=PATIENCE_MS)
    assert press_view.work.heightmap is None
    assert not press_view.map.map.has_image
    assert press_view.map.layer.tools == () and press_view.map.hint.text() == ""
    press_view.release()

    # An opened image is not of the recording, whose position is not shown meanwhile.
    press_view.open_file(press)
    assert not press_view.replay.isVisible()
    press_view.release()
    assert press_view.replay.isVisible()
    assert press_view.map.map._words.text() == "No depth yet."


def test_a_live_image_is_kept_with_its_measurement_but_not_one_that_is_a_file_already(
    page, context, qtbot
):
    rgb = np.random.default_rng(3).integers(0, 256, (24, 32, 3), np.uint8)
    live, replayed = SourceFrame(rgb, 7, 1.0), SourceFrame(rgb, 7, 1.0, index=7)
    for count, frame in enumerate((live, replayed), 1):
        measured = (Quantity("distance_mm", 9.0 + count),)
        page.book.add(MeasurementRecord("A-1", "", "distance", measured), int, frame)
        _kept(page, qtbot, count)
    files = [record.settings.get("file", "") for record in page.book.records]
    assert files[1] == ""
    assert np.array_equal(cv2.imread(files[0])[..., ::-1], rgb)
    assert Path(files[0]).is_relative_to(context.workspace.sensor_folder("A-1"))
    page.book.add(replace(page.book.records[0], picture=Path(files[0]).name, note="again"), int)
    qtbot.waitUntil(lambda: not page.book.busy)
    assert len(page.book.records) == 2, "measured on the kept image, it is the same measurement"
    page.tabs.setCurrentWidget(page.results)
    page.results.table.choose(page.book.records[0].id)
    page.results.open_action.trigger()
    assert page.press_view.work.image.path == Path(files[0])


@pytest.mark.parametrize(("system", "value"), [("de_DE", "10,25"), ("en_GB", "10.25")])
def test_the_table_has_the_decimal_sign_of_the_system_and_the_dialog_says_so(
    page, qtbot, tmp_path, monkeypatch, system, value
):
    table, patterns = tmp_path / "records.csv", []
    monkeypatch.setattr(QLocale, "system", lambda: QLocale(system))
    page.book.add(MeasurementRecord("A-1", "", "distance", (Quantity("distance_mm", 10.25),)), int)
    _kept(page, qtbot, 1)
    monkeypatch.setattr(
        QFileDialog, "getSaveFileName", lambda *given: patterns.append(given[3]) or (str(table), "")
    )
    page.results.export_action.trigger()
    qtbot.waitUntil(lambda: table.exists() and not page.book.busy)
    (titles, cells) = (line for _, line in read_csv(table))
    assert cells[titles.index("value")] == value
    assert ("comma" in patterns[0]) is ("," in value)


def test_one_measurement_has_no_spread_and_each_column_its_own_title(page, qtbot):
    page.book.add(MeasurementRecord("A-1", "", "distance", (Quantity("distance_mm", 10.25),)), int)
    _kept(page, qtbot, 1)
    assert "10.2500" in page.results.statistics.text()
    assert "0.0000" not in page.results.statistics.text()
    assert len(set(TITLES)) == len(TITLES)


def test_another_workspace_is_read_at_once_and_pending_changes_are_refused(
    page, context, qtbot, tmp_path
):
    book, go = page.book, threading.Event()
    record = MeasurementRecord("A-1", "", "distance", (Quantity("distance_mm", 9.0),))
    book.add(record, lambda _number: None)
    _kept(page, qtbot, 1)
    book.remove((book.records[0].id,))
    _kept(page, qtbot, 0)
    refused: list[str] = []
    book.noticed.connect(refused.append)
    waiting = threading.Event()

    def wait(_records: Store) -> None:
        waiting.set()
        go.wait(60.0)

    book.change("Waiting", wait)
    assert waiting.wait(60.0)
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
