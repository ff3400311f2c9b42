"""The dialog for error against run time."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import pytest
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot

from app.context.context import AppContext
from app.tools import precision_dialog
from app.tools.precision_dialog import PrecisionDialog
from app.tools.precision_plot import LIMITS, PrecisionPlot
from gelpolight_core.calibration.file import write_calibration
from gelpolight_core.experiments.front.measure import Point
from gelpolight_core.experiments.front.trial import USUAL, measure_calibration, usual_methods
from gelpolight_core.sensor_calibration import Calibration

POINT = Point(
    "A", "paper", "paper's model", "paper", 1280, 1.2, 0.02, 10.0, 12.0, 30.0, 6.0, 2.0, 2.6
)
POINTS = (
    POINT,
    replace(POINT, method="full_fast", label="full model, fast", family="effort", rms_um=9.0),
    replace(POINT, method="full_best", family="effort", median_ms=900.0, p95_ms=950.0, rms_um=4.0),
    replace(POINT, method="bare", median_ms=None, p95_ms=None, rms_um=None, gap="refused"),
)


@pytest.fixture
def dialog(
    context: AppContext, small_calibration: Calibration, qtbot: QtBot
) -> Iterator[PrecisionDialog]:
    path = context.workspace.calibration_path("virtual-1", "small")
    write_calibration(small_calibration, path)
    context.workspace.use(path)
    made = PrecisionDialog(context=context)
    made.show()
    yield made
    made.close()
    made.deleteLater()


def test_the_calibration_in_use_is_measured_on_rendered_presses(
    dialog: PrecisionDialog,
    small_calibration: Calibration,
    monkeypatch: pytest.MonkeyPatch,
    qtbot: QtBot,
) -> None:
    asked = []

    def measure(calibration: Calibration, *arguments: object, **options: object) -> object:
        asked.append(calibration.identity)
        return POINTS

    monkeypatch.setattr(precision_dialog, "measure_virtual", measure)
    assert dialog.start.isEnabled()
    assert "virtual" in dialog.presses.text()
    dialog.start.click()
    qtbot.waitUntil(lambda: bool(dialog.points), timeout=20_000)
    assert asked == [small_calibration.identity]
    assert "small" in dialog.calibrations.currentText()
    assert dialog.table.rowCount() == len(POINTS)
    assert "refused" in dialog.words.text()
    for row in range(dialog.error.count()):
        dialog.error.setCurrentIndex(row)
    assert not dialog.grab().isNull()


def test_its_report_equals_that_of_the_command_line(
    dialog: PrecisionDialog, tmp_path: Path, qtbot: QtBot
) -> None:
    dialog._done(POINTS)
    dialog.write_report(tmp_path)
    qtbot.waitUntil(lambda: not dialog.jobs.busy, timeout=20_000)
    assert "full model, fast" in (tmp_path / "work-precision.html").read_text("utf-8")
    assert (tmp_path / "work-precision.csv").is_file()


def test_presses_of_another_sensor_are_refused_in_one_sentence(
    dialog: PrecisionDialog, tmp_path: Path, small_session: Path, qtbot: QtBot
) -> None:
    text = (small_session / "session.toml").read_text("utf-8")
    (tmp_path / "session.toml").write_text(text.replace('"virtual-1"', '"other"'), "utf-8")
    dialog.use_folder(tmp_path)
    dialog.start.click()
    qtbot.waitUntil(lambda: not dialog.jobs.busy, timeout=20_000)
    assert "other" in dialog.words.text() and "virtual-1" in dialog.words.text()
    assert dialog.start.isEnabled()


def test_a_calibration_is_measured_in_the_modes_offered_to_users(
    small_calibration: Calibration, small_session: Path
) -> None:
    methods = [m for m in usual_methods() if m.name in ("paper", "full_balanced")]
    points = measure_calibration(small_calibration, small_session, methods, repeats=1)
    assert [p.method for p in points] == ["paper", "full_balanced"]
    assert all(p.median_ms and p.rms_um for p in points)
    assert {m.name for m in usual_methods()} == set(USUAL)


@pytest.mark.parametrize("mode", ["escape", "close"])
def test_it_can_be_closed_and_shown_again(
    dialog: PrecisionDialog, mode: str, monkeypatch: pytest.MonkeyPatch, qtbot: QtBot
) -> None:
    monkeypatch.setattr(precision_dialog, "measure_virtual", lambda *_, **__: POINTS)
    for _ in range(2):
        if mode == "escape":
            qtbot.keyClick(dialog, Qt.Key.Key_Escape)
        else:
            dialog.close()
        assert not dialog.isVisible()
        dialog.show()
    dialog.start.click()
    qtbot.waitUntil(lambda: bool(dialog.points), timeout=20_000)


def test_closing_it_stops_the_measurement(
    dialog: PrecisionDialog, monkeypatch: pytest.MonkeyPatch, qtbot: QtBot
) -> None:
    begun = threading.Event()

    def measure(*_arguments: object, progress: Callable[..., object], **_: object) -> object:
        begun.set()
        while True:
            progress("press", 0.5)

    monkeypatch.setattr(precision_dialog, "measure_virtual", measure)
    dialog.start.click()
    assert begun.wait(20.0)
    qtbot.keyClick(dialog, Qt.Key.Key_Escape)
    assert not dialog.isVisible()
    assert not dialog.jobs.busy
    dialog.show()
    assert dialog.start.isEnabled()
    assert not dialog.stop.isEnabled()


def ticks(plot: PrecisionPlot, side: str) -> list[str]:
    return [text for _, text in plot._plot.getAxis(side)._tickLevels[0]]


def test_the_axes_have_round_values_at_any_zoom(dialog: PrecisionDialog) -> None:
    plot = dialog.plot
    view = plot._plot.getViewBox()
    assert ticks(plot, "bottom")
    for _ in range(200):
        view.scaleBy((4.0, 4.0))
    # The axis update must work for every zoom of a mouse wheel.
    dialog._done(POINTS)
    (left, right), (bottom, top) = plot._plot.viewRange()
    assert LIMITS["xMin"] <= left < right <= LIMITS["xMax"]
    assert LIMITS["yMin"] <= bottom < top <= LIMITS["yMax"]
    dialog._done(())
    for _ in range(200):
        view.scaleBy((4.0, 4.0))
    assert ticks(plot, "bottom") == [f"{10.0**power:g}" for power in range(-3, 9)]
    view.setRange(xRange=(1.0, 2.0), yRange=(0.1, 0.4), padding=0.0)
    assert ticks(plot, "bottom") == ["10", "20", "50", "100"]
    view.setRange(xRange=(0.95, 1.15), yRange=(-0.5, 2.5), padding=0.0)
    assert ticks(plot, "bottom") == ["9", "10", "11", "12", "13", "14"]
    assert ticks(plot, "left") == "0.5 1 2 5 10 20 50 100 200".split()
    for _ in range(200):
        view.scaleBy((0.25, 0.25))
    assert 3 <= len(ticks(plot, "bottom")) <= 9
    assert 3 <= len(ticks(plot, "left")) <= 9
