"""The plot of errors over time follows the theme."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from app.measure.error_plot import ErrorPlot
from app.services.preferences import Limits
from app.theme import theme
from gelpolight_core.measurement.quantity import Quantity
from gelpolight_core.records.entry import MeasurementRecord


@pytest.fixture
def plot(qapp: QApplication, qtbot: QtBot) -> Iterator[ErrorPlot]:
    made = ErrorPlot()
    qtbot.addWidget(made)
    yield made
    theme.apply(qapp, "light")


def test_what_is_measured_along_the_depth_is_judged_by_the_limit_of_heights(
    plot: ErrorPlot,
) -> None:
    quantities = tuple(
        Quantity(f"{name}_mm", 1.02, truth=1.0) for name in ("depth_difference", "distance")
    )
    plot.show_records((MeasurementRecord("A-1", "", "distance", quantities),), Limits())
    assert [len(points) for points in plot.shown.values()] == [1, 1]
