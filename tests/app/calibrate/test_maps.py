"""Results as pictures."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from PySide6.QtWidgets import QApplication
from pytestqt.qtbot import QtBot

from app.calibrate.maps import MapsView, Panel


def panels(count: int) -> list[Panel]:
    return [Panel(f"{k}", np.zeros((9, 12, 3), np.uint8), "") for k in range(count)]


def test_a_single_picture_has_the_whole_room(qapp: QApplication, qtbot: QtBot) -> None:
    view = MapsView()
    qtbot.addWidget(view)
    view.resize(600, 400)
    view.show()
    for count, share in ((1, 0.9), (2, 0.4), (3, 0.4), (1, 0.9)):
        view.show_panels(panels(count))
        qapp.processEvents()
        assert view._shown[0].width() > share * view.width()
        assert len({shown.geometry().topLeft().toTuple() for shown in view._shown}) == count


def test_the_words_stay_at_the_picture(qapp: QApplication, qtbot: QtBot) -> None:
    """Also where the room is higher than the picture can be, and after it was larger."""
    view = MapsView()
    qtbot.addWidget(view)
    view.show()
    view.show_panels([replace(panels(1)[0], caption="what it is")])
    for size in ((300, 700), (900, 900), (300, 400), (700, 300)):
        view.resize(*size)
        qapp.processEvents()
        qapp.processEvents()
        (panel,) = view._shown
        picture, pixmap = panel._picture, panel._picture.pixmap()
        assert picture.height() - pixmap.height() <= 2
        assert panel._caption.y() - picture.geometry().bottom() < 20
        assert max(pixmap.width() / panel.width(), pixmap.height() / panel.height()) > 0.75
