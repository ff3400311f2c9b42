"""The figure of an evaluation follows the theme."""

from __future__ import annotations

from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from app.measure.protocol_plot import Fig13
from app.shell import theme


class Counting(Fig13):
    """Counts how often it is drawn anew."""

    drawn = 0

    def _draw(self) -> None:
        self.drawn += 1


def test_it_is_drawn_anew_once_when_the_theme_has_changed(qapp: QApplication, qtbot: QtBot) -> None:
    """Not while Qt goes through its widgets to tell them: plots are made and deleted by it."""
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
