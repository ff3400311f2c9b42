"""Results as pictures."""

from __future__ import annotations

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
