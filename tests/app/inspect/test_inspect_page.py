"""The Inspect page, as a technician meets it."""

from __future__ import annotations

import logging
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QLabel, QPushButton
from pytestqt.qtbot import QtBot

from app.inspect.actions import POLL_MS
from app.inspect.export import ExportChoice
from app.inspect.page import InspectPage
from app.inspect.zero import FRAMES, zero_calibration
from app.shell.context import AppContext
from app.sources.processor import Outcome
from gelpolight_core.calibration.calibration import Calibration
from gelpolight_core.calibration.file import write_calibration
from gelpolight_core.errors import InputError
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.session import read_picture

WAIT_MS = 60_000


@pytest.fixture
def page(context: AppContext, qtbot: QtBot) -> Iterator[InspectPage]:
    made = InspectPage(context=context)
    made.resize(1180, 760)
    made.show()
    yield made
    made.leave()
    made.may_close()
    made.close()
    made.deleteLater()


@pytest.fixture
def presses(small_session: Path, context: AppContext) -> Path:
    """Return a folder with one press, chosen as the camera."""
    from app.sources.listing import picture_folders

    (info,) = picture_folders([small_session / "balls"])()
    context.source.choose(info)
    return small_session / "balls"


def _use(page: InspectPage, calibration: Calibration) -> None:
    """Look through a calibration by the paper's model, which is quick."""
    reconstructor = Reconstructor(calibration, model="paper")
    page.calibrations.loaded.emit(reconstructor, reconstructor)


def _wait_for_depth(page: InspectPage, qtbot: QtBot) -> None:
    def there() -> bool:
        return page.link.last is not None and page.link.last.heightmap is not None

    qtbot.waitUntil(there, timeout=WAIT_MS)


def _advice(page: InspectPage) -> tuple[str, QPushButton]:
    text = page.findChild(QLabel, "inspect.advice")
    button = page.findChild(QPushButton, "inspect.advised")
    assert text is not None and button is not None
    return text.text(), button


def test_without_anything_it_says_what_to_do_next(page: InspectPage) -> None:
    page.enter()
    text, button = _advice(page)
    assert "choose where the pictures come from" in text
    assert button.isVisible()


def test_the_virtual_sensor_without_a_calibration_can_be_calibrated_by_one_click(
    page: InspectPage, context: AppContext
) -> None:
    page.enter()
    _, button = _advice(page)
    button.click()
    assert context.source.info is not None and context.source.info.kind == "virtual"
    text, button = _advice(page)
    assert "Only" in text or "only" in text
    assert "Calibrate the virtual sensor now" in button.text()
    assert page.views.docks["bench"].isVisible()


def test_depth_is_shown_in_3d_once_for_each_frame(
    page: InspectPage, presses: Path, small_calibration: Calibration, qtbot: QtBot
) -> None:
    page.enter()
    _use(page, small_calibration)
    surface = page.views.surface
    qtbot.waitUntil(lambda: surface.view is not None, timeout=WAIT_MS)
    assert surface.view is not None and surface.reason == ""
    view = surface.view
    qtbot.waitUntil(lambda: view.drawings > 3, timeout=WAIT_MS)
    frames, drawings = page.views.height.map.shown_pictures, view.drawings
    qtbot.waitUntil(lambda: view.drawings > drawings + 5, timeout=WAIT_MS)
    shown = page.views.height.map.shown_pictures - frames
    # The last frame's painting may be under way.
    assert abs((view.drawings - drawings) - shown) <= 1
    picture = view.grab().toImage()
    middle = picture.pixelColor(picture.width() // 2, picture.height() // 2)
    corner = picture.pixelColor(4, 4)
    assert middle != corner


def test_nothing_is_made_for_a_view_that_is_hidden(
    page: InspectPage, presses: Path, small_calibration: Calibration, qtbot: QtBot
) -> None:
    for name in ("surface", "section", "camera", "normals", "quality"):
        page.views.docks[name].hide()
    page.enter()
    _use(page, small_calibration)
    _wait_for_depth(page, qtbot)
    last = page.link.last
    assert last is not None and last.height is not None
    assert last.surface is None and last.normals is None and last.quality is None
    assert last.cut is None
    assert page.views.surface.view is None


def test_the_cursor_is_in_all_views_and_read_below(
    page: InspectPage, presses: Path, small_calibration: Calibration, qtbot: QtBot
) -> None:
    page.enter()
    _use(page, small_calibration)
    _wait_for_depth(page, qtbot)
    page.views.pointed.emit(1.0, 2.0)
    readout = page.findChild(QLabel, "inspect.readout")
    assert readout is not None
    assert "x 1.00 mm" in readout.text() and "depth" in readout.text()
    assert page.views.height.map._lines[0].value() == 1.0


def test_a_standing_picture_stands_until_it_goes_on(
    page: InspectPage, presses: Path, small_calibration: Calibration, qtbot: QtBot
) -> None:
    page.enter()
    _use(page, small_calibration)
    _wait_for_depth(page, qtbot)
    page.activateWindow()
    page.setFocus()
    qtbot.waitUntil(page.hasFocus, timeout=WAIT_MS)
    qtbot.keyClick(page, Qt.Key.Key_Space)
    assert page.link.paused
    qtbot.wait(200)
    assert page.link.last is not None
    number = page.link.last.frame.number
    qtbot.wait(400)
    assert page.link.last.frame.number == number
    page.pause_action.trigger()
    qtbot.waitUntil(lambda: page.link.last.frame.number > number, timeout=WAIT_MS)  # type: ignore[union-attr]


def test_a_calibration_of_another_size_is_refused_and_says_which(
    page: InspectPage, tmp_path: Path, context: AppContext, small_calibration: Calibration,
    qtbot: QtBot,
) -> None:  # fmt: skip
    from app.sources.listing import picture_folders

    folder = tmp_path / "others"
    folder.mkdir()
    cv2.imwrite(str(folder / "one.png"), np.full((100, 120, 3), 90, np.uint8))
    (info,) = picture_folders([folder])()
    context.source.choose(info)
    page.enter()
    _use(page, small_calibration)
    qtbot.waitUntil(lambda: "120x100" in _advice(page)[0], timeout=WAIT_MS)


def test_a_calibration_of_another_sensor_is_refused_and_says_whose(
    page: InspectPage, context: AppContext, small_calibration: Calibration, qtbot: QtBot
) -> None:
    context.source.choose_virtual_sensor()
    page.enter()
    sensor = replace(small_calibration.sensor, serial="lab-7")
    _use(page, replace(small_calibration, sensor=sensor))
    text, button = _advice(page)
    assert "lab-7" in text and "virtual-1" in text
    assert "Calibrate the virtual sensor" in button.text()
    assert page.link.live is None


def _wait_for_section(page: InspectPage, qtbot: QtBot) -> None:
    qtbot.waitUntil(lambda: page.views.section.cut.profile is not None, timeout=WAIT_MS)


def test_nothing_of_a_calibration_stays_when_it_is_no_longer_looked_through(
    page: InspectPage, presses: Path, small_calibration: Calibration, qtbot: QtBot
) -> None:
    page.enter()
    _use(page, small_calibration)
    _wait_for_section(page, qtbot)
    views, link = page.views, page.link
    page.views.pointed.emit(1.0, 2.0)
    figures = page.findChild(QLabel, "inspect.section.figures")
    readout = page.findChild(QLabel, "inspect.readout")
    assert figures is not None and readout is not None
    assert views.height.map.has_picture and figures.text() and readout.text()
    late = Outcome(link._processor.generation, link.last.frame, link.last)  # type: ignore[union-attr]
    page.calibrations.loaded.emit(None, None)
    link._outbox.put(late)
    link._take()
    page._tell()
    assert not views.height.map.has_picture
    assert views.section.cut.profile is None
    assert (figures.text(), readout.text()) == ("", "")
    assert page._places is None


def test_a_picture_stands_no_longer_than_the_page_is_looked_at(
    page: InspectPage, presses: Path, small_calibration: Calibration, qtbot: QtBot
) -> None:
    page.enter()
    _use(page, small_calibration)
    _wait_for_depth(page, qtbot)
    page.pause(True)
    page.leave()
    page.enter()
    assert not page.link.paused and not page.pause_action.isChecked()
    _wait_for_depth(page, qtbot)


def test_a_standing_picture_goes_with_its_source(
    page: InspectPage, presses: Path, small_session: Path, context: AppContext,
    small_calibration: Calibration, qtbot: QtBot,
) -> None:  # fmt: skip
    from app.sources.listing import picture_folders

    page.enter()
    _use(page, small_calibration)
    _wait_for_section(page, qtbot)
    page.pause(True)
    (info,) = picture_folders([small_session / "background"])()
    context.source.choose(info)
    assert not page.views.height.map.has_picture
    assert not page.link.paused and not page.pause_action.isChecked()
    _wait_for_section(page, qtbot)


def test_the_layout_is_found_again_as_it_was_left(
    page: InspectPage, context: AppContext, qtbot: QtBot
) -> None:
    page.enter()
    page.views.docks["normals"].hide()
    page.views.docks["section"].hide()
    page.leave()
    again = InspectPage(context=context)
    qtbot.addWidget(again)
    assert again.views.docks["normals"].isHidden()
    assert not again.views.docks["height"].isHidden()
    again.may_close()


def test_the_frame_that_is_shown_is_exported_as_reconstructed(
    page: InspectPage, presses: Path, small_calibration: Calibration, tmp_path: Path, qtbot: QtBot
) -> None:
    page.enter()
    _use(page, small_calibration)
    _wait_for_depth(page, qtbot)
    page.pause(True)
    qtbot.wait(300)
    last = page.link.last
    assert last is not None and last.heightmap is not None
    page.deeds.run_export(ExportChoice(tmp_path / "out", ("npz",)))
    path = tmp_path / "out" / f"frame-{last.frame.number:05d}.npz"
    qtbot.waitUntil(path.is_file, timeout=WAIT_MS)
    with np.load(path, allow_pickle=False) as stored:
        np.testing.assert_array_equal(stored["depth_mm"], last.heightmap.depth_mm)


def test_a_recording_is_made_and_replayed(
    page: InspectPage, presses: Path, context: AppContext, small_calibration: Calibration,
    qtbot: QtBot,
) -> None:  # fmt: skip
    page.enter()
    _use(page, small_calibration)
    _wait_for_depth(page, qtbot)
    page.recorder.start()
    qtbot.wait(800)
    page.recorder.stop()
    qtbot.waitUntil(lambda: not page.recorder.busy, timeout=4 * WAIT_MS)
    (path,) = context.workspace.folder.glob("sensors/*/recordings/*.gplrec")
    page.open_path(path)
    _wait_for_depth(page, qtbot)
    assert page.replay.isVisible()
    source = page.link.stream.source  # type: ignore[union-attr]
    assert source.header.calibration_id == small_calibration.identity  # type: ignore[attr-defined]


def test_a_recording_ends_where_the_camera_is_opened_again(
    page: InspectPage, presses: Path, small_calibration: Calibration, qtbot: QtBot
) -> None:
    page.enter()
    _use(page, small_calibration)
    _wait_for_depth(page, qtbot)
    page.recorder.start()
    qtbot.wait(300)
    page.link.open()
    assert not page.recorder.action.isChecked()
    qtbot.waitUntil(lambda: not page.recorder.busy, timeout=WAIT_MS)


def test_zero_puts_the_background_of_now_into_use_and_can_be_undone(
    page: InspectPage, small_session: Path, context: AppContext, small_calibration: Calibration,
    qtbot: QtBot,
) -> None:  # fmt: skip
    from app.sources.listing import picture_folders

    (info,) = picture_folders([small_session / "background"])()
    context.source.choose(info)
    path = context.workspace.calibration_path(small_calibration.sensor.serial, "mine")
    write_calibration(small_calibration, path)
    context.workspace.use(path)
    page.enter()
    qtbot.waitUntil(lambda: page.link.reconstructor is not None, timeout=4 * WAIT_MS)
    page.deeds.zero()
    zero = path.with_name("mine-zero.gplcal")
    qtbot.waitUntil(lambda: context.workspace.in_use == zero, timeout=WAIT_MS)
    qtbot.waitUntil(lambda: not page.jobs.busy, timeout=4 * WAIT_MS)
    page.deeds._use(path)
    assert context.workspace.in_use == path


def test_undo_of_a_second_zero_brings_back_what_is_kept(
    page: InspectPage, small_session: Path, context: AppContext, small_calibration: Calibration,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    workspace, offered = context.workspace, []
    path = workspace.calibration_path(small_calibration.sensor.serial, "mine")
    write_calibration(small_calibration, path)
    kept = path.read_bytes()
    picture = min((small_session / "background").glob("*.png"))
    frames = [read_picture(picture).rgb] * FRAMES
    first = zero_calibration(workspace, path, frames)
    second = zero_calibration(workspace, first.path, frames)
    assert workspace.in_use == first.path == second.path != path
    monkeypatch.setattr(context.toasts, "show", lambda *_, actions: offered.extend(actions))
    page.deeds._on_zeroed(second)
    ((_, undo),) = offered
    undo()
    assert workspace.in_use == path
    assert path.read_bytes() == kept


def test_leaving_while_zero_waits_for_its_frames_is_no_failure(
    page: InspectPage, presses: Path, context: AppContext, qtbot: QtBot,
    small_calibration: Calibration, caplog: pytest.LogCaptureFixture,
) -> None:  # fmt: skip
    path = context.workspace.calibration_path(small_calibration.sensor.serial, "mine")
    write_calibration(small_calibration, path)
    context.workspace.use(path)
    page.enter()
    page.deeds.zero()
    waiting = page.deeds._capture
    page.leave()
    assert waiting is not None
    assert isinstance(waiting.exception(), InputError)  # its frames never came
    qtbot.wait(3 * POLL_MS)
    assert [record.message for record in caplog.records if record.levelno > logging.INFO] == []
    assert context.workspace.in_use == path


def test_where_3d_is_not_to_be_had_the_relief_is_shown_and_the_reason_said(
    page: InspectPage, presses: Path, small_calibration: Calibration, qtbot: QtBot,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    from app.inspect.scene3d import Scene

    def refuse(_self: Scene) -> None:
        raise InputError("OpenGL 3.2 is not to be had here", where="3D view", advice="Install it")

    monkeypatch.setattr(Scene, "__init__", refuse)
    page.enter()
    _use(page, small_calibration)
    qtbot.waitUntil(lambda: page.views.surface.reason != "", timeout=WAIT_MS)
    _wait_for_depth(page, qtbot)
    assert "OpenGL" in page.views.surface.reason
    flat = page.views.surface._flat
    assert flat is not None
    qtbot.waitUntil(lambda: flat.shown_pictures > 0, timeout=WAIT_MS)
