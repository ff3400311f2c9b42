"""The Inspect page as a technician uses it."""

import logging
import shutil
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QComboBox, QLabel, QPushButton, QWidget
from pytestqt.qtbot import QtBot

from app.inspect.export import SHOWN_FROM, ExportChoice, export_frame
from app.inspect.page import InspectPage
from app.inspect.section_panel import REGION_INK
from app.live import calibration_choice
from app.live.calibration_choice import zero_calibration
from app.live.frame_processor import FrameResult
from app.live.frame_viewer import ViewLayout
from app.program.calibration_entries import read_entry
from app.program.first_steps import FirstSteps
from app.source_ui.bench_panel import BenchPanel
from app.sources.latest import Done
from app.sources.recorder import RecordingSpace
from gelpolight_core.calibration.calibration_file import write_calibration
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.sensor.sensor_calibration import Calibration
from gelpolight_core.session.session_images import read_linear_image

WAIT_MS = 300_000


@pytest.fixture(autouse=True)
def _prepared(prepared_sensor, monkeypatch):
    """Offer the virtual sensor's calibration, as after the set-up."""
    monkeypatch.setattr(calibration_choice, "prepared", lambda: prepared_sensor)


@pytest.fixture
def page(context, qtbot):
    made = InspectPage(context=context)
    made.resize(1180, 760)
    made.views.stage.arrange(ViewLayout("four", section=True))
    made.show()
    yield made
    made.leave()
    made.can_close()
    made.close()
    made.deleteLater()


@pytest.fixture
def presses(small_session, context):
    """Return a folder with one press, selected as the camera."""
    context.source.choose_folder(small_session / "balls")
    return small_session / "balls"


def _use(page: InspectPage, calibration: Calibration) -> None:
    """Show depth through a calibration with the paper's model, which is fast."""
    reconstructor = Reconstructor(calibration, model="paper")
    page.live_depth.load(reconstructor, reconstructor)


def _wait_for_depth(page: InspectPage, qtbot: QtBot) -> None:
    def there() -> bool:
        return page.live_depth.last is not None and page.live_depth.last.heightmap is not None

    qtbot.waitUntil(there, timeout=WAIT_MS)


@pytest.fixture
def pressed(page, presses, small_calibration, qtbot):
    """Return the page while it shows the depth of a press."""
    page.enter()
    _use(page, small_calibration)
    _wait_for_depth(page, qtbot)
    return page


def _advice(page: InspectPage) -> tuple[str, QPushButton]:
    text = page.findChild(QLabel, "inspect.advice")
    button = page.findChild(QPushButton, "inspect.advised")
    return text.text(), button


@pytest.mark.function("Calibrate the virtual sensor with one click")
def test_the_virtual_sensor_without_a_calibration_can_be_calibrated_by_one_click(page, context):
    page.enter()
    _, button = _advice(page)
    button.click()
    assert context.source.info is not None and context.source.info.kind == "virtual"
    text, button = _advice(page)
    assert "Only" in text or "only" in text
    assert "Calibrate the virtual sensor now" in button.text()
    button.click()
    assert context.workspace.in_use is not None
    assert read_entry(context.workspace.in_use).validated


@pytest.mark.function("Start the program on the virtual sensor, without any hardware")
def test_the_demo_shows_the_depth_of_a_coin_that_moves_until_it_is_touched(page, context, qtbot):
    page.enter()
    page.begin_demo()
    assert page.findChild(FirstSteps).isVisible()
    panel = page.findChild(BenchPanel)
    assert panel is not None and panel.isVisible()
    _wait_for_depth(page, qtbot)
    last = page.live_depth.last
    assert last is not None and last.heightmap is not None
    assert float(last.heightmap.depth_mm.max()) == pytest.approx(0.6, rel=0.1)
    bench = context.source.bench
    assert bench is not None
    scene = bench.scene
    qtbot.waitUntil(lambda: bench.scene != scene, timeout=WAIT_MS)
    page.begin_press()
    items = panel.findChild(QComboBox, "bench.item")
    assert items is not None and items.view().isVisible()
    items.hidePopup()
    scene, number = bench.scene, last.frame.number
    qtbot.waitUntil(lambda: page.live_depth.last.frame.number > number + 5, timeout=WAIT_MS)  # type: ignore[union-attr]
    assert bench.scene == scene


@pytest.mark.function("See the depth live in several views")
def test_depth_is_shown_in_3d_once_for_each_frame(page, presses, small_calibration, qtbot):
    page.enter()
    _use(page, small_calibration)
    surface = page.views.surface
    qtbot.waitUntil(lambda: surface.view is not None, timeout=WAIT_MS)
    assert surface.view is not None and surface.reason == ""
    view = surface.view
    qtbot.waitUntil(lambda: view.drawings > 3, timeout=WAIT_MS)
    frames, drawings = page.views.map_panel.map.shown_images, view.drawings
    qtbot.waitUntil(lambda: view.drawings > drawings + 5, timeout=WAIT_MS)
    shown = page.views.map_panel.map.shown_images - frames
    # The painting of the last frame may still be running.
    assert abs((view.drawings - drawings) - shown) <= 1
    image = view.grabFramebuffer()
    middle = image.pixelColor(image.width() // 2, image.height() // 2)
    corner = image.pixelColor(4, 4)
    assert middle != corner


@pytest.mark.function("Lock the colour range by dragging the colour bar")
def test_dragging_the_colour_bar_locks_the_range_and_a_double_click_releases_it(page):
    height, display = page.views.map_panel, page.views.display
    height.map.bar.range_dragged.emit(0.1, 0.45)
    assert display.value.range_mm == pytest.approx((0.1, 0.45))
    assert page.live_depth._maker.wanted.display.range_mm == display.value.range_mm
    height.map.bar_double_clicked.emit()
    assert display.value.range_mm is None
    assert page.live_depth._maker.wanted.display.range_mm is None


@pytest.mark.function("Arrange the views, and find them again")
def test_the_layout_is_restored(page, context, qtbot):
    page.enter()
    page.views.stage.arrange(ViewLayout("four", section=True))
    page.views.stage.arrange(ViewLayout("normals", section=True, maximised=True))
    page.leave()
    again = InspectPage(context=context)
    qtbot.addWidget(again)
    assert again.views.stage.arranged == ViewLayout("normals", section=True)
    assert not again.views.normals.isHidden() and again.views.map_panel.isHidden()
    again.can_close()


@pytest.mark.function(
    "See that a recording loses frames, and record every second one",
    "Record and replay on the Inspect page",
)
def test_a_recording_is_made_and_replayed(
    pressed, context, small_calibration, qtbot, caplog, monkeypatch
):
    pressed.recorder.start()
    qtbot.waitUntil(lambda: pressed.recorder.action.text().endswith("left"), timeout=WAIT_MS)
    monkeypatch.setattr(  # it stops by itself
        "app.inspect.record_control.recording_space",
        lambda figures, **_: RecordingSpace(-1.0, 0.0, by_limit=True),
    )
    qtbot.waitUntil(lambda: not pressed.recorder.busy, timeout=WAIT_MS)
    assert pressed.recorder.action.text() == "Record"
    assert "size limit" in caplog.text
    (path,) = context.workspace.folder.glob("sensors/*/recordings/*.gplrec")
    # One that loses frames says so in red, and offers half the rate.
    monkeypatch.undo()
    context.toasts.attach(pressed, lambda: None)
    pressed.recorder.start()
    state = pressed.findChild(QLabel, "inspect.recorded")
    qtbot.waitUntil(state.isVisible, timeout=WAIT_MS)
    assert state.property("meaning") == "muted"
    banner, live = _advice(pressed)[0], "Recording the live image"
    assert live not in state.text() and pressed.unfinished()
    pressed.pause(True)
    assert _advice(pressed)[0] != banner
    qtbot.waitUntil(lambda: state.text().startswith(live), timeout=WAIT_MS)
    pressed.pause(False)
    assert _advice(pressed)[0] == banner
    recorder = pressed.recorder._recorder
    with recorder._changed:
        recorder._note(lost=7)
    qtbot.waitUntil(lambda: "7 lost" in state.text(), timeout=WAIT_MS)
    assert state.property("meaning") == "fail"
    (toast,) = (t for t in context.toasts.shown() if "loses frames" in t.finding.text)
    (button,) = (b for b in toast.findChildren(QPushButton) if "second frame" in b.text())
    button.click()
    assert recorder._every == 2
    pressed.recorder.stop()
    qtbot.waitUntil(lambda: not pressed.recorder.busy, timeout=WAIT_MS)
    assert not state.isVisible() and not pressed.unfinished()
    context.toasts.clear()

    pressed.open_path(path)
    _wait_for_depth(pressed, qtbot)
    assert pressed.replay.isVisible()
    source = pressed.live.stream.source  # type: ignore[union-attr]
    assert source.header.calibration_id == small_calibration.identity  # type: ignore[attr-defined]


@pytest.mark.function("Use the current image as the zero reference")
def test_zero_uses_the_present_background_and_can_be_undone(
    page, small_session, context, small_calibration, qtbot, monkeypatch, caplog
):
    workspace, control = context.workspace, page.live_depth.zero
    page.views.stage.arrange(ViewLayout("camera"))  # without a live depth
    context.source.choose_folder(small_session / "background")
    path = workspace.calibration_path(small_calibration.serial, "mine")
    write_calibration(small_calibration, path)
    kept = path.read_bytes()
    workspace.use(path)
    page.enter()
    control.set_zero()
    assert page.live.capturing
    page.leave()
    assert not page.live.capturing  # its frames never arrived
    qtbot.wait(100)
    levels = [record.levelno for record in caplog.records if record.levelno > logging.INFO]
    assert levels == [logging.WARNING]
    assert workspace.in_use == path

    page.enter()
    qtbot.waitUntil(lambda: page.live_depth.reconstructor is not None, timeout=4 * WAIT_MS)
    control.set_zero()
    zero = path.with_name("mine-zero.gplcal")
    qtbot.waitUntil(lambda: workspace.in_use == zero, timeout=WAIT_MS)
    qtbot.waitUntil(lambda: not page.jobs.busy, timeout=4 * WAIT_MS)
    # Undo of a second zero restores the original.
    rgb, shown = read_linear_image(min((small_session / "background").glob("*.png"))).rgb, []
    second = zero_calibration(workspace, zero, [0.9 * rgb] * 2)
    assert workspace.in_use == second[0] == zero
    monkeypatch.setattr(
        context.toasts, "show", lambda *said, actions: shown.append((said, actions))
    )
    control._on_zeroed(second)
    (((text, verdict), ((_, undo),)),) = shown
    assert verdict == "warn" and "The background had changed" in text
    undo()
    assert workspace.in_use == path
    assert path.read_bytes() == kept


def _last(page: InspectPage) -> FrameResult:
    last = page.live_depth.last
    return last


def _region_shown(page: InspectPage) -> bool:
    return any(tool.role == REGION_INK for tool in page.views.map_panel.layer.tools)


@pytest.mark.function(
    "Freeze an image at full detail",
    "Read depth, slope and flags under the cursor",
    "Level a frozen height map, and subtract an earlier one",
    "Subtract a held reference",
    "Export the shown frame as it was reconstructed",
)
def test_a_frozen_image_is_read_exported_processed_and_continued(pressed, tmp_path, qtbot):
    # The cursor is shared by all views, with its values.
    pressed.views.stage.point_at(1.0, 2.0)
    readout, value = (pressed.findChild(QLabel, f"inspect.{name}") for name in ("readout", "depth"))
    assert readout is not None and "x 1.00, y 2.00 mm" in readout.text()
    assert value is not None and value.text().endswith((" mm", " µm"))
    assert pressed.views.map_panel.map._lines[0].value() == 1.0
    # A point with a flag has one line more, but nothing below it moves.
    qtbot.wait(1)
    before, lines = pressed.modes.box.y(), readout.text().count("\n")
    pressed.views.stage.point_at(*pressed.views.map_panel.map._extent.topLeft().toTuple())
    qtbot.waitUntil(lambda: readout.text().count("\n") == lines + 1)
    qtbot.wait(1)
    assert pressed.modes.box.y() == before

    # A levelling that was chosen before is used from the freezing on, and named.
    line, level, hold, reset, subtract = (
        pressed.findChild(QWidget, f"inspect.{name}")
        for name in (
            "processed.steps", "processing.level", "processing.hold", "processed.reset",
            "processing.subtract",
        )
    )  # fmt: skip
    level.setCurrentIndex(level.findData("plane"))
    assert not pressed.processed.isVisible()
    pressed.activateWindow()
    pressed.setFocus()
    qtbot.waitUntil(pressed.hasFocus, timeout=WAIT_MS)
    qtbot.keyClick(pressed, Qt.Key.Key_Space)
    assert pressed.live.paused
    qtbot.waitUntil(pressed.processed.isVisible, timeout=WAIT_MS)
    frozen = _last(pressed)
    assert frozen.raw is not None and frozen.processed[0] in line.text()
    assert not np.array_equal(frozen.raw.depth_mm, frozen.heightmap.depth_mm)
    level.setCurrentIndex(level.findData("rectangle"))
    qtbot.waitUntil(lambda: _last(pressed).heightmap is not frozen.heightmap, timeout=WAIT_MS)
    assert _region_shown(pressed)
    reset.click()
    qtbot.waitUntil(lambda: not pressed.processed.isVisible(), timeout=WAIT_MS)
    assert level.currentData() == "none" and not _region_shown(pressed)
    assert _last(pressed).heightmap is _last(pressed).raw

    # The shown frame is exported as it was reconstructed.
    choice, shares = ExportChoice(formats=("npz",), folder=str(tmp_path / "out")), list[float]()
    export_frame(_last(pressed).heightmap, choice, "again.png", shares.append)
    assert shares[0] >= SHOWN_FROM  # a large file takes seconds
    pressed.export.run(choice)
    path = tmp_path / "out" / f"{Path(frozen.frame.name).stem}.npz"
    qtbot.waitUntil(path.is_file, timeout=WAIT_MS)
    with np.load(path, allow_pickle=False) as stored:
        np.testing.assert_array_equal(stored["depth_mm"], _last(pressed).heightmap.depth_mm)

    # A held reference is subtracted.
    assert not subtract.isEnabled()
    hold.click()
    subtract.setChecked(True)
    qtbot.waitUntil(pressed.processed.isVisible, timeout=WAIT_MS)
    assert np.abs(_last(pressed).heightmap.depth_mm).max() == pytest.approx(0.0, abs=1e-6)

    assert _last(pressed).frame.number == frozen.frame.number
    pressed.pause_action.trigger()
    qtbot.waitUntil(lambda: _last(pressed).frame.number > frozen.frame.number, timeout=WAIT_MS)


@pytest.mark.function("Step through a folder of images file by file")
def test_a_frozen_image_of_a_folder_keeps_its_name_and_the_next_file_is_shown_live(
    page, small_session, small_calibration, context, tmp_path, qtbot
):
    for name in ("a.png", "b.png"):
        shutil.copy(min((small_session / "background").glob("*.png")), tmp_path / name)
    context.source.choose_folder(tmp_path)
    page.enter()
    _use(page, small_calibration)
    _wait_for_depth(page, qtbot)
    words = page.findChild(QLabel, "inspect.replay.words")
    assert words.isVisible() and words.text().startswith("a.png")
    page.findChild(QAction, "replay.play").trigger()
    qtbot.waitUntil(lambda: _last(page).frame.name == "b.png", timeout=WAIT_MS)
    page.pause(True)
    frozen = page._shown.frame.name
    qtbot.wait(300)  # it would have played on
    assert words.text().startswith(frozen)
    page.pause(False)
    others = {"a.png", "b.png"} - {frozen}
    qtbot.waitUntil(lambda: _last(page).frame.name in others, timeout=WAIT_MS)
    page.replay.step(-1)
    page.pause(True)
    assert page.replay.step(1) and words.text().startswith("b.png")
    assert not page.live.paused
    qtbot.waitUntil(lambda: _last(page).frame.name == "b.png", timeout=WAIT_MS)


@pytest.mark.function("See why there is no depth of another sensor's image")
def test_an_image_of_another_sensor_is_reported_in_place_of_its_depth_and_not_exported(
    page, small_session, small_calibration, context, tmp_path, qtbot, monkeypatch
):
    shown = read_linear_image(min((small_session / "background").glob("*.png"))).rgb.shape
    noise = np.random.default_rng(0).integers(0, 255, shown, np.uint8)
    cv2.imwrite(str(tmp_path / "other.png"), noise)
    context.source.choose_folder(tmp_path)
    page.enter()
    _use(page, small_calibration)
    qtbot.waitUntil(lambda: _last(page) is not None and _last(page).health is not None)
    fault = _last(page).fault
    assert _last(page).heightmap is None
    qtbot.waitUntil(lambda: _advice(page)[0] == fault.line)  # it lasts
    views, said = page.views, list[str]()
    assert views.surface._words.text() == fault.line and not views.map_panel.map.has_image
    assert views.section.cut.profile is None
    monkeypatch.setattr(context.toasts, "show", lambda text, *_: said.append(text))
    page.export.ask()
    assert said == [fault.line]


def test_nothing_stays_on_the_page_of_a_source_or_calibration_that_is_not_used_any_more(
    pressed, small_session, context, qtbot
):
    views, live = pressed.views, pressed.live

    def cut_is_shown() -> bool:
        return views.section.cut.profile is not None

    qtbot.waitUntil(cut_is_shown, timeout=WAIT_MS)
    pressed.pause(True)
    context.source.choose_folder(small_session / "background")
    assert not views.map_panel.map.has_image
    assert not live.paused and not pressed.pause_action.isChecked()

    qtbot.waitUntil(cut_is_shown, timeout=WAIT_MS)
    views.stage.point_at(1.0, 2.0)
    texts = [
        pressed.findChild(QLabel, f"inspect.{name}") for name in ("section.figures", "readout")
    ]
    assert views.map_panel.map.has_image and all(label.text() for label in texts)
    last = _last(pressed)
    live._latest._done = (last.frame,), Done(last.frame, last)  # type: ignore[union-attr]
    pressed.live_depth.load(None, None)
    live._poll()
    pressed._show_texts()
    assert not views.map_panel.map.has_image
    assert not cut_is_shown()
    assert [label.text() for label in texts] == ["", ""]
    assert views.stage._pixel_map is None


@pytest.mark.function("Be refused a calibration of another sensor or image size")
def test_a_calibration_of_another_sensor_or_image_size_is_refused_with_both(
    page, tmp_path, context, small_calibration, qtbot
):
    context.source.choose_virtual_sensor()
    page.enter()
    sensor = replace(small_calibration.data.sensor, serial="lab-7")
    _use(page, small_calibration.changed(sensor=sensor))
    text, button = _advice(page)
    assert "lab-7" in text and "virtual-1" in text
    assert "Calibrate the virtual sensor" in button.text()
    assert page.live_depth.live_reconstructor is None

    (tmp_path / "others").mkdir()
    cv2.imwrite(str(tmp_path / "others" / "one.png"), np.full((100, 120, 3), 90, np.uint8))
    context.source.choose_folder(tmp_path / "others")
    _use(page, small_calibration)
    qtbot.waitUntil(lambda: "120x100" in _advice(page)[0], timeout=WAIT_MS)
