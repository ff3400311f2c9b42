"""The plot of errors over time follows the theme."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from app.measure.drift_plot import DriftPlot
from app.shell import theme


@pytest.fixture
def plot(qapp: QApplication, qtbot: QtBot) -> Iterator[DriftPlot]:
    made = DriftPlot()
    qtbot.addWidget(made)
    yield made
    theme.apply(qapp, "light")


def test_its_legend_can_be_read_in_both_themes(qapp: QApplication, plot: DriftPlot) -> None:
    for dark, name in ((False, "light"), (True, "dark"), (False, "light")):
        theme.apply(qapp, name)
        for _, label in plot._legend.items:
            assert theme.COLOURS["text"][dark] in label.item.toHtml()
