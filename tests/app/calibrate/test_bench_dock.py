"""The user moves the object on the virtual bench with the mouse."""

from __future__ import annotations

import pytest
from PySide6.QtWidgets import QMainWindow
from pytestqt.qtbot import QtBot

from app.calibrate.bench_dock import BenchDock
from app.context.context import AppContext
from app.sources.bench import Bench


@pytest.fixture
def bench(context: AppContext) -> Bench:
    """Return the bench of the virtual sensor, which is the selected camera."""
    context.source.choose_virtual_sensor()
    assert context.source.bench is not None
    return context.source.bench


@pytest.fixture
def dock(context: AppContext, bench: Bench, qtbot: QtBot) -> BenchDock:
    """Return the bench dock in a window."""
    window = QMainWindow()
    qtbot.addWidget(window)
    return BenchDock(context.source, window)


@pytest.mark.parametrize("item", ["ball", "checkerboard"])
def test_the_grabbed_point_of_an_object_follows_the_pointer(
    dock: BenchDock, bench: Bench, item: str
) -> None:
    before = bench.lay(item)
    u, v = 600.0, 500.0
    start = bench.position_mm(u, v)
    assert start is not None
    dock.drag("begin", u, v)
    assert bench.scene == before
    dock.drag("move", u + 30.0, v - 10.0)
    dock.drag("end", u + 40.0, v - 20.0)
    end = bench.position_mm(u + 40.0, v - 20.0)
    assert end is not None
    assert bench.scene.x_mm - before.x_mm == pytest.approx(end[0] - start[0])
    assert bench.scene.y_mm - before.y_mm == pytest.approx(end[1] - start[1])
    after = bench.scene
    dock.drag("move", u, v)  # the mouse button was released
    assert bench.scene == after


def test_objects_that_cover_the_whole_sensor_cannot_be_dragged(
    dock: BenchDock, bench: Bench
) -> None:
    before = bench.lay("mirror")
    for phase in ("begin", "move", "end"):
        dock.drag(phase, 300.0, 300.0)
    assert bench.scene == before
