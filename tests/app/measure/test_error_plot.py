"""The plot of errors over time."""

from __future__ import annotations

from pytestqt.qtbot import QtBot

from app.measure.error_plot import ErrorPlot
from app.services.preferences import Limits
from gelpolight_core.quantity import Quantity
from gelpolight_core.records.entry import MeasurementRecord


def test_what_is_measured_along_the_depth_is_judged_by_the_limit_of_heights(qtbot: QtBot) -> None:
    plot = ErrorPlot()
    qtbot.addWidget(plot)
    quantities = tuple(
        Quantity(f"{name}_mm", 1.02, truth=1.0) for name in ("depth_difference", "distance")
    )
    plot.show_records((MeasurementRecord("A-1", "", "distance", quantities),), Limits())
    assert [len(points) for points in plot.shown.values()] == [1, 1]
