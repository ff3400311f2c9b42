"""Two sensors side by side: each with its own source, calibration and faults."""

from __future__ import annotations

import gc
import threading
import weakref
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from fake_camera import C310, FakeCamera, FakeDriver
from PySide6.QtCore import QCoreApplication, QEvent, Qt
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QAbstractButton, QComboBox, QDockWidget, QLabel, QWidget
from pytestqt.qtbot import QtBot

from app.context.context import AppContext
from app.inspect.export import ExportChoice
from app.inspect.page import InspectPage
from app.inspect.second_sensor import SecondSensor
from app.live.zero import FRAMES, SECOND_SUFFIX, original_of, zero_calibration
from app.sources.listing import image_folders
from app.sources.source import SourceInfo
from app.workspace.workspace import SECOND_STATE, Workspace
from gelpolight_core.calibration.file import write_calibration
from gelpolight_core.errors import InputError
from gelpolight_core.export.raster import read_npz
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.session.images import read_image

WAIT_MS = 60_000
TWIN = replace(C310, identity="046d:081b@SN2", address="/dev/video2")


@pytest.fixture
def page(context: AppContext, qtbot: QtBot) -> Iterator[InspectPage]:
    made = InspectPage(context=context)
    made.resize(1180, 760)
    made.show()
    made.enter()
    yield made
    made.may_close()
    made.leave()
    made.close()
    made.deleteLater()


@pytest.fixture
def pane(page: InspectPage) -> SecondSensor:
    page.second.action.trigger()
    assert page.second.pane is not None
    return page.second.pane


@pytest.fixture
def other_calibration(small_calibration: Calibration) -> Calibration:
    """Return the calibration of another sensor, whose LEDs are elsewhere."""
    return replace(
        small_calibration,
        sensor=replace(small_calibration.sensor, serial="finger-2"),
        led_positions_mm=small_calibration.led_positions_mm * 1.3,
    )


def _still(path: Path, folder: Path) -> SourceInfo:
    """Return a source that shows one image again and again."""
    folder.mkdir()
    cv2.imwrite(str(folder / "one.png"), cv2.imread(str(path), cv2.IMREAD_UNCHANGED))
    (info,) = image_folders([folder])()
    return info


def _use(part: InspectPage | SecondSensor, calibration: Calibration) -> Reconstructor:
    """Show depth through a calibration with the paper's model, which is fast."""
    made = Reconstructor(calibration, model="paper")
    part.depth.calibrations.loaded.emit(made, made)
    return made


def _depth(part: InspectPage | SecondSensor) -> np.ndarray | None:
    last = part.depth.last
    return None if last is None or last.heightmap is None else last.heightmap.depth_mm


def _delete() -> None:
    QCoreApplication.sendPostedEvents(None, QEvent.Type.DeferredDelete)


def test_two_sensors_show_their_own_depth_at_the_same_time(
    page: InspectPage, pane: SecondSensor, context: AppContext, small_session: Path,
    small_calibration: Calibration, other_calibration: Calibration, tmp_path: Path, qtbot: QtBot,
) -> None:  # fmt: skip
    one, two = sorted((small_session / "balls").glob("*.png"))[:2]
    context.source.choose(_still(one, tmp_path / "one"))
    pane.context.source.choose(_still(two, tmp_path / "two"))
    _use(page, small_calibration)
    _use(pane, other_calibration)
    qtbot.waitUntil(lambda: _depth(page) is not None and _depth(pane) is not None, timeout=WAIT_MS)
    counts = page.views.height.map.shown_images, pane.height.map.shown_images

    def both_go_on() -> bool:
        now = page.views.height.map.shown_images, pane.height.map.shown_images
        return min(now[0] - counts[0], now[1] - counts[1]) >= 3

    qtbot.waitUntil(both_go_on, timeout=WAIT_MS)
    for part, path, calibration in (
        (page, one, small_calibration),
        (pane, two, other_calibration),
    ):
        rgb = cv2.cvtColor(cv2.imread(str(path)), cv2.COLOR_BGR2RGB)
        expected = Reconstructor(calibration, model="paper").depth(rgb).depth_mm
        assert part.depth.last is not None and part.depth.last.heightmap is not None
        assert part.depth.last.heightmap.calibration_id == calibration.identity
        np.testing.assert_allclose(_depth(part), expected, atol=1e-4)
    wrong = Reconstructor(small_calibration, model="paper").depth(rgb).depth_mm
    assert np.nanmax(np.abs(_depth(pane) - wrong)) > 0.1, "each has a calibration of its own"
    pane.show_texts()
    text = pane.findChild(QLabel, "second.depth")
    largest = float(np.nanmax(_depth(pane)))  # type: ignore[arg-type]
    assert text is not None
    assert float(text.text().split()[-2]) == pytest.approx(largest, abs=1e-3)
    assert pane.height.map.bar.isVisible()


def test_the_settings_of_the_display_are_those_of_the_first_sensor(
    page: InspectPage, pane: SecondSensor
) -> None:
    page.views.height.range_dragged.emit(0.1, 0.45)
    assert pane.depth._maker.wanted.display.range_mm == pytest.approx((0.1, 0.45))
    assert pane.depth._maker.wanted.height
    page.views.docks["look"].raise_()
    QCoreApplication.processEvents()
    assert not pane.depth._maker.wanted.height, "it is hidden by another tab"


def test_closing_it_leaves_nothing(
    page: InspectPage, context: AppContext, small_session: Path, small_calibration: Calibration,
    qtbot: QtBot,
) -> None:  # fmt: skip
    threads = set(threading.enumerate())
    page.second.action.trigger()
    assert page.second.pane is not None and page.second.action.isChecked()
    (info,) = image_folders([small_session / "balls"])()
    page.second.pane.context.source.choose(info)
    made = weakref.ref(_use(page.second.pane, small_calibration))
    page.second.pane.show_bench()
    qtbot.waitUntil(lambda: _depth(page.second.pane) is not None, timeout=WAIT_MS)  # type: ignore[arg-type]
    dock = page.findChild(QDockWidget, "inspect.dock.second")
    assert dock is not None
    button = dock.findChild(QAbstractButton, "qt_dockwidget_closebutton")
    assert button is not None
    qtbot.mouseClick(button, Qt.MouseButton.LeftButton)
    _delete()
    gc.collect()
    assert made() is None, "its memory is released"
    assert page.second.pane is None and not page.second.action.isChecked()
    assert page.findChild(QDockWidget, "inspect.dock.second") is None
    assert page.findChild(QWidget, "second.bench.window") is None
    assert context.source.other is None
    left = {thread for thread in threading.enumerate() if not thread.name.startswith("image rows")}
    assert left <= threads
    page.second.action.trigger()
    assert page.second.pane is not None
    again = page.second.pane.context.source.info
    assert again is not None and again.file == info.file


def test_source_and_calibration_are_remembered(
    page: InspectPage, pane: SecondSensor, context: AppContext, small_session: Path,
    small_calibration: Calibration, other_calibration: Calibration, qtbot: QtBot,
) -> None:  # fmt: skip
    workspace = context.workspace
    first = workspace.keep_calibration(small_calibration, "first")
    second = workspace.keep_calibration(other_calibration, "second")
    workspace.use(first)
    context.requests.calibrations_changed.emit()
    box = pane.findChild(QComboBox, "second.calibration")
    assert box is not None
    box.activated.emit(box.findData(str(second)))
    assert (workspace.in_use, pane.context.workspace.in_use) == (first, second)
    (info,) = image_folders([small_session / "balls"])()
    pane.context.source.choose(info)
    page.may_close()
    page.leave()
    again = InspectPage(context=context)
    qtbot.addWidget(again)
    assert again.second.pane is not None, "it was open at the end"
    dock = again.findChild(QDockWidget, "inspect.dock.second")
    assert dock in again.views.tabifiedDockWidgets(again.views.docks["look"])
    chosen = again.second.pane.context
    assert chosen.source.info is not None
    assert (chosen.source.info.kind, chosen.source.info.file) == ("folder", info.file)
    assert chosen.workspace.in_use == second
    assert context.source.info is None
    again.second.close()
    again.may_close()
    third = InspectPage(context=context)
    qtbot.addWidget(third)
    assert third.second.pane is None
    third.may_close()


def test_a_camera_belongs_to_one_sensor(
    page: InspectPage, context: AppContext, qtbot: QtBot
) -> None:
    context.cameras.driver = FakeDriver(FakeCamera(), FakeCamera(device=TWIN))
    page.second.action.trigger()
    pane = page.second.pane
    assert pane is not None
    one, two = context.cameras.infos()
    context.source.choose(one)
    with pytest.raises(InputError, match="the first sensor"):
        pane.context.source.choose(one)
    assert pane.context.source.info is None
    pane.context.source.choose(two)
    with pytest.raises(InputError, match="the second sensor"):
        context.source.choose(two)
    assert context.source.info is one
    for part, name, allowed in ((page, "inspect", [True, False]), (pane, "second", [False, True])):
        button = part.findChild(QWidget, f"{name}.source")
        button.list_cameras()  # type: ignore[union-attr]
        actions = [part.findChild(QAction, f"{name}.source.camera.{number}") for number in range(2)]
        assert [action.isEnabled() for action in actions] == allowed  # type: ignore[union-attr]
    button = pane.findChild(QWidget, "second.source")
    button.use_camera(one)  # type: ignore[union-attr]
    assert "the first sensor" in context.toasts.history[-1].text
    page.second.close()
    context.source.choose(two)
    assert context.source.info is two


def test_the_first_sensor_goes_on_when_the_second_camera_is_unplugged(
    page: InspectPage, context: AppContext, small_session: Path, small_calibration: Calibration,
    tmp_path: Path, qtbot: QtBot,
) -> None:  # fmt: skip
    fake = FakeCamera()
    context.cameras.driver = FakeDriver(fake)
    (path, *_) = sorted((small_session / "balls").glob("*.png"))
    context.source.choose(_still(path, tmp_path / "one"))
    page.second.action.trigger()
    pane = page.second.pane
    assert pane is not None
    pane.context.source.choose(context.cameras.infos()[0])
    _use(page, small_calibration)
    _use(pane, small_calibration)  # of another image size
    qtbot.waitUntil(lambda: pane.depth.state.size is not None, timeout=WAIT_MS)
    assert pane.depth.state.size != page.depth.state.size
    assert pane.depth.live_reconstructor is None
    advice = pane.findChild(QLabel, "second.advice")
    width, height = pane.depth.state.size  # type: ignore[misc]
    assert advice is not None and f"{width}x{height}" in advice.text()
    fake.plugged = False
    qtbot.waitUntil(lambda: pane.depth.state.trouble != "", timeout=WAIT_MS)
    assert (page.depth.state.trouble, page.depth.state.fault) == ("", None)
    shown = page.views.height.map.shown_images
    qtbot.waitUntil(lambda: page.views.height.map.shown_images > shown + 2, timeout=WAIT_MS)
    assert context.status.value.camera == "one"
    page.second.close()
    qtbot.waitUntil(lambda: not any("video0" in t.name for t in threading.enumerate()))


def test_setting_zero_of_one_sensor_leaves_the_calibration_of_the_other(
    context: AppContext, small_session: Path, small_calibration: Calibration
) -> None:
    (path, *_) = sorted((small_session / "background").glob("*.png"))
    frames = [read_image(path).rgb] * FRAMES
    workspace = context.workspace
    used = workspace.keep_calibration(small_calibration, "small")
    second = Workspace(workspace.folder, state=SECOND_STATE)
    workspace.use(used)
    second.use(used)
    first_zero = zero_calibration(workspace, used, frames).path
    before = first_zero.read_bytes()
    second_zero = zero_calibration(second, first_zero, frames, suffix=SECOND_SUFFIX).path
    assert workspace.in_use == first_zero and first_zero.read_bytes() == before
    assert second.in_use == second_zero != first_zero
    assert original_of(first_zero) == original_of(second_zero) == used


def test_it_follows_another_workspace(
    pane: SecondSensor, context: AppContext, small_calibration: Calibration, tmp_path: Path
) -> None:
    context.workspace.folder = tmp_path / "elsewhere"
    path = context.workspace.calibration_path("virtual-1", "small")
    write_calibration(small_calibration, path)
    context.requests.calibrations_changed.emit()
    assert [entry.path for entry in pane.depth.calibrations.entries] == [path]


def test_the_layout_is_reset_around_it(page: InspectPage, pane: SecondSensor) -> None:
    page.views.arrange()
    dock = page.findChild(QDockWidget, "inspect.dock.second")
    assert dock is not None and dock in page.views.tabifiedDockWidgets(page.views.docks["look"])
    assert pane.isVisible() and page.second.pane is pane


def test_pause_freezes_both_sensors(
    page: InspectPage, pane: SecondSensor, context: AppContext, small_session: Path,
    small_calibration: Calibration, tmp_path: Path, qtbot: QtBot,
) -> None:  # fmt: skip
    (path, *_) = sorted((small_session / "balls").glob("*.png"))
    for part, name in ((page, "one"), (pane, "two")):
        part.context.source.choose(_still(path, tmp_path / name))
        _use(part, small_calibration)
    qtbot.waitUntil(lambda: _depth(page) is not None and _depth(pane) is not None, timeout=WAIT_MS)
    page.pause_action.trigger()
    assert page.live.paused and pane.depth.live.paused
    assert pane.depth._maker.wanted.still
    pane.context.source.choose(_still(path, tmp_path / "three"))
    assert not pane.depth.live.paused and page.live.paused, "another source starts live"
    page.pause_action.trigger()
    assert not page.live.paused and not pane.depth._maker.wanted.still


def test_it_records_and_exports_on_its_own(
    page: InspectPage, pane: SecondSensor, context: AppContext, small_session: Path,
    other_calibration: Calibration, tmp_path: Path, qtbot: QtBot,
) -> None:  # fmt: skip
    (path, *_) = sorted((small_session / "balls").glob("*.png"))
    pane.context.source.choose(_still(path, tmp_path / "two"))
    _use(pane, other_calibration)
    qtbot.waitUntil(lambda: _depth(pane) is not None, timeout=WAIT_MS)
    pane.recorder.action.trigger()
    assert not page.recorder.busy
    qtbot.waitUntil(lambda: "left" in pane.recorder.action.text(), timeout=WAIT_MS)
    pane.recorder.action.trigger()
    qtbot.waitUntil(lambda: not pane.recorder.busy, timeout=WAIT_MS)
    (recorded,) = context.workspace.recordings_folder("finger-2").iterdir()
    assert recorded.stat().st_size > 0
    pane.export.run(ExportChoice(tmp_path / "out", ("npz",)))
    qtbot.waitUntil(lambda: (tmp_path / "out").is_dir() and not pane.jobs.busy, timeout=WAIT_MS)
    (exported,) = (tmp_path / "out").glob("*.npz")
    assert read_npz(exported).calibration_id == other_calibration.identity
