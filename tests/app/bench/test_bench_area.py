"""The controls of the virtual sensor are not cut off at the side."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDockWidget, QMainWindow
from pytestqt.qtbot import QtBot

from app.bench.bench_area import BenchArea
from app.context.context import AppContext


def test_the_area_is_as_wide_as_the_controls_of_each_object(
    context: AppContext, qtbot: QtBot
) -> None:
    window, area = QMainWindow(), BenchArea(context.source)
    qtbot.addWidget(window)
    dock = QDockWidget(window)
    dock.setWidget(area)
    window.addDockWidget(Qt.DockWidgetArea.LeftDockWidgetArea, dock)
    window.show()
    assert not area.follow()
    context.source.choose_virtual_sensor()
    bench = context.source.bench
    assert area.follow() and bench is not None
    for item in ("bare", "cylinder", "cuboid"):
        bench.lay(item)
        panel = area.widget()
        qtbot.waitUntil(
            lambda panel=panel: (
                panel.width() >= panel.minimumSizeHint().width()
                and area.viewport().width() >= panel.width()
            )
        )
