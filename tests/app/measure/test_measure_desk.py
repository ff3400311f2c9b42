"""A picture that is held while another calibration, or none, comes into use."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from pytestqt.qtbot import QtBot

from app.measure.desk import Desk
from app.measure.tool_layer import DrawnTool
from app.shell.context import AppContext
from app.shell.jobs import Jobs
from gelpolight_core.calibration.calibration import Calibration
from gelpolight_core.calibration.file import write_calibration
from gelpolight_core.measurement.tools import Distance
from gelpolight_core.recording.recording import RecordingHeader
from gelpolight_core.recording.writer import RecordingWriter

PATIENCE_MS = 60_000


@pytest.fixture
def desk(context: AppContext, small_calibration: Calibration, tmp_path: Path) -> Iterator[Desk]:
    """Return the desk, shown, with the small sensor's calibration in use."""
    _use(context, small_calibration, tmp_path / "small.gplcal")
    jobs = Jobs("desk")
    made = Desk(jobs, context=context)
    made.show()
    made.enter()
    yield made
    made.leave()
    made.close_work()
    jobs.close()
    made.close()
    made.deleteLater()


def _use(context: AppContext, calibration: Calibration, path: Path) -> None:
    write_calibration(calibration, path)
    context.workspace.use(context.workspace.import_calibration(path))
    context.requests.calibrations_changed.emit()


def _press(session: Path) -> Path:
    return next(iter(sorted((session / "presses").glob("cylinder*.png"))))


def test_without_a_calibration_nothing_of_the_last_one_stays_on_the_map(
    desk: Desk, context: AppContext, small_session: Path, qtbot: QtBot
) -> None:
    drawn: list[tuple[DrawnTool, ...]] = []
    desk.map.drawn.connect(lambda tools, _chosen: drawn.append(tools))
    desk.open_file(_press(small_session))
    qtbot.waitUntil(lambda: desk.work.heightmap is not None, timeout=PATIENCE_MS)
    desk.work.add(Distance((-2.0, 0.0), (2.0, 0.0)))
    qtbot.waitUntil(lambda: desk.work.result is not None, timeout=PATIENCE_MS)
    assert drawn[-1][0].text
    assert desk.map.view.has_picture
    context.workspace.use(None)
    context.requests.calibrations_changed.emit()
    assert [tool.text for tool in drawn[-1]] == [""]
    assert not desk.map.view.has_picture


def test_a_held_frame_is_not_measured_with_another_sensors_calibration(
    desk: Desk,
    context: AppContext,
    small_calibration: Calibration,
    small_session: Path,
    qtbot: QtBot,
    tmp_path: Path,
) -> None:
    serial = small_calibration.sensor.serial
    rgb = np.ascontiguousarray(cv2.imread(str(_press(small_session)))[..., ::-1])
    path = tmp_path / "press.gplrec"
    with RecordingWriter(path, RecordingHeader(serial=serial)) as writer:
        for number in range(4):
            writer.append(rgb, number, 100.0 + 0.05 * number)
    desk.auto.setChecked(False)
    desk.open_file(path)
    qtbot.waitUntil(desk.hold_action.isEnabled, timeout=PATIENCE_MS)
    desk.hold()
    qtbot.waitUntil(lambda: desk.work.heightmap is not None, timeout=PATIENCE_MS)
    other = replace(small_calibration, sensor=replace(small_calibration.sensor, serial="B-2"))
    _use(context, other, tmp_path / "other.gplcal")
    advice = desk.banner.findChild(object, "inspect.advice")
    said = f"the picture is of {serial}"
    qtbot.waitUntil(lambda: said in advice.text(), timeout=PATIENCE_MS)
    assert desk.work.heightmap is None
    assert not desk.map.view.has_picture
    desk.release()
    assert desk.map.view._words.text() == "No depth yet."
