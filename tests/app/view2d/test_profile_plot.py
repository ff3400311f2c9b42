"""The plot of a section follows the theme."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from app.theme import theme
from app.view2d.profile_plot import ProfilePlot


@pytest.fixture
def plot(qapp: QApplication, qtbot: QtBot) -> Iterator[ProfilePlot]:
    made = ProfilePlot("section")
    qtbot.addWidget(made)
    made.resize(300, 160)
    made.show()
    yield made
    theme.apply(qapp, "light")


def test_its_background_follows_the_theme(qapp: QApplication, plot: ProfilePlot) -> None:
    """A white background in a dark window is too bright, and hides the axis labels."""
    for dark, name in ((False, "light"), (True, "dark"), (False, "light")):
        theme.apply(qapp, name)
        qapp.processEvents()
        corner = plot.grab().toImage().pixelColor(2, 2)
        assert corner == QColor(theme.COLOURS["base"][dark])
