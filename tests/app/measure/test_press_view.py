"""A frozen image while another calibration, or none, is selected."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from pytestqt.qtbot import QtBot

from app.context.context import AppContext
from app.measure.press_view import PressView
from app.services.jobs import Jobs
from gelpolight_core.calibration.file import write_calibration
from gelpolight_core.measurement.tools import Distance
from gelpolight_core.recording.recording import RecordingHeader
from gelpolight_core.recording.writer import RecordingWriter
from gelpolight_core.sensor_calibration import Calibration

PATIENCE_MS = 60_000


@pytest.fixture
def press_view(
    context: AppContext, small_calibration: Calibration, tmp_path: Path
) -> Iterator[PressView]:
    """Return the visible view, with the small sensor's calibration in use."""
    _use(context, small_calibration, tmp_path / "small.gplcal")
    jobs = Jobs("desk")
    made = PressView(
        jobs, on_save=print, on_edit=lambda: None, on_records=lambda: None, context=context
    )
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
    press_view: PressView, context: AppContext, small_session: Path, qtbot: QtBot
) -> None:
    press_view.open_file(_press(small_session))
    qtbot.waitUntil(lambda: press_view.work.heightmap is not None, timeout=PATIENCE_MS)
    press_view.work.add(Distance((-2.0, 0.0), (2.0, 0.0)))
    qtbot.waitUntil(lambda: press_view.work.result is not None, timeout=PATIENCE_MS)
    assert press_view.map.drawn[0].text
    assert press_view.map.view.has_image
    context.workspace.use(None)
    context.requests.calibrations_changed.emit()
    assert [tool.text for tool in press_view.map.drawn] == [""]
    assert not press_view.map.view.has_image


def test_a_frozen_frame_is_not_measured_with_another_sensors_calibration(
    press_view: PressView,
    context: AppContext,
    small_calibration: Calibration,
    small_session: Path,
    qtbot: QtBot,
    tmp_path: Path,
) -> None:
    serial = small_calibration.serial
    rgb = np.ascontiguousarray(cv2.imread(str(_press(small_session)))[..., ::-1])
    path = tmp_path / "press.gplrec"
    with RecordingWriter(path, RecordingHeader(serial=serial)) as writer:
        for number in range(4):
            writer.append(rgb, number, 100.0 + 0.05 * number)
    press_view.inspector.auto.setChecked(False)
    press_view.open_file(path)
    qtbot.waitUntil(press_view.freeze_action.isEnabled, timeout=PATIENCE_MS)
    press_view.freeze()
    qtbot.waitUntil(lambda: press_view.work.heightmap is not None, timeout=PATIENCE_MS)
    other = small_calibration.changed(sensor=replace(small_calibration.data.sensor, serial="B-2"))
    _use(context, other, tmp_path / "other.gplcal")
    advice = press_view.banner.findChild(object, "inspect.advice")
    output = f"sensor {serial}"
    qtbot.waitUntil(lambda: output in advice.text(), timeout=PATIENCE_MS)
    assert press_view.work.heightmap is None
    assert not press_view.map.view.has_image
    press_view.release()
    assert press_view.map.view._words.text() == "No depth yet."
