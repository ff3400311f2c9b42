"""The dialog for error against run time."""

import threading
from collections.abc import Callable
from dataclasses import replace

import pytest
from PySide6.QtCore import Qt

from app.tools import precision_dialog
from app.tools.precision_dialog import PrecisionDialog
from gelpolight_core.calibration.file import write_calibration
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.studies.work_precision import Point

POINT = Point("A", "paper", "paper's model", 1280, 0.02, 4, 10.0, 12.0, 30.0, 6.0, 2.0, 2.6)
POINTS = (
    POINT,
    replace(POINT, mode="fast", label="full model, fast", median_ms=20.0, p95_ms=25.0, rms_um=9.0),
    replace(POINT, mode="best", label="full model, best", median_ms=900.0, p95_ms=950.0, rms_um=4),
)


@pytest.fixture
def dialog(context, small_calibration, qtbot):
    path = context.workspace.calibration_path("virtual-1", "small")
    write_calibration(small_calibration, path)
    context.workspace.use(path)
    made = PrecisionDialog(context=context)
    made.show()
    yield made
    made.close()
    made.deleteLater()


def test_the_calibration_in_use_is_measured_and_the_recommended_mode_follows_the_rate(
    dialog, small_calibration, monkeypatch, tmp_path, qtbot
):
    asked = []

    def measure(_design: object, calibration: Calibration, **_: object) -> object:
        asked.append(calibration.identity)
        return POINTS

    monkeypatch.setattr(precision_dialog, "measure_virtual", measure)
    assert dialog.start.isEnabled()
    assert "virtual" in dialog.presses.text()
    dialog.start.click()
    qtbot.waitUntil(lambda: bool(dialog.points))
    assert asked == [small_calibration.identity]
    assert "small" in dialog.calibrations.currentText()
    assert len(dialog.table.shown) == len(POINTS)
    assert dialog.table.shown[1][0] == "full model, fast"
    assert not dialog.figure.pixmap().isNull()
    assert "best" in dialog.advice.text()
    dialog.rate.setValue(30.0)
    assert "fast" in dialog.advice.text()
    dialog.limit.setValue(1.0)
    assert "No mode" in dialog.advice.text()
    dialog.write_report(tmp_path)
    qtbot.waitUntil(lambda: not dialog.jobs.busy)
    assert "full model, fast" in (tmp_path / "work-precision.csv").read_text("utf-8")
    assert (tmp_path / "work-precision.png").is_file()


def test_closing_it_stops_the_measurement(dialog, monkeypatch, qtbot):
    begun = threading.Event()

    def measure(*_arguments: object, progress: Callable[..., object], **_: object) -> object:
        begun.set()
        while True:
            progress("press", 0.5)

    monkeypatch.setattr(precision_dialog, "measure_virtual", measure)
    dialog.start.click()
    assert begun.wait(60.0)
    qtbot.keyClick(dialog, Qt.Key.Key_Escape)
    assert not dialog.isVisible()
    assert not dialog.jobs.busy
    dialog.show()
    assert dialog.start.isEnabled()
    assert not dialog.stop.isEnabled()
