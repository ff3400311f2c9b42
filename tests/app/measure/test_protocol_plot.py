"""The figure of an evaluation follows the theme."""

from __future__ import annotations

from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from app.measure.protocol_plot import Fig13
from app.theme import theme


class Counting(Fig13):
    """Counts how often it is redrawn."""

    drawn = 0

    def _draw(self) -> None:
        self.drawn += 1


def test_a_theme_change_redraws_it_once(qapp: QApplication, qtbot: QtBot) -> None:
    """Not while Qt walks over its widgets to notify them: the redraw creates and deletes plots."""
    figure = Counting()
    qtbot.addWidget(figure)
    figure.show()
    try:
        theme.apply(qapp, "dark")
        assert figure.drawn == 0
        qtbot.waitUntil(lambda: figure.drawn == 1)
    finally:
        theme.apply(qapp, "light")
    qtbot.waitUntil(lambda: figure.drawn == 2)
