"""Stage results as images."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
from pytestqt.qtbot import QtBot

from app.calibrate.maps import MapsView, Panel

WAIT_MS = 60_000


def panels(count: int) -> list[Panel]:
    return [Panel(f"{k}", np.zeros((9, 12, 3), np.uint8), "") for k in range(count)]


def is_filled(view: MapsView, count: int, share: float) -> None:
    assert share * view.width() < view._shown[0].width() <= view.width()
    assert len({shown.geometry().topLeft().toTuple() for shown in view._shown}) == count


def test_a_single_image_uses_the_whole_area(qtbot: QtBot) -> None:
    view = MapsView()
    qtbot.addWidget(view)
    view.resize(600, 400)
    view.show()
    for count, share in ((1, 0.9), (2, 0.4), (3, 0.4), (1, 0.9)):
        view.show_panels(panels(count))
        qtbot.waitUntil(partial(is_filled, view, count, share), timeout=WAIT_MS)


def is_captioned(view: MapsView) -> None:
    is_filled(view, 1, 0.9)  # otherwise it has the size from before
    (panel,) = view._shown
    image, pixmap = panel._image, panel._image.pixmap()
    assert image.height() - pixmap.height() <= 2
    assert panel._caption.y() - image.geometry().bottom() < 20
    wide, high = pixmap.width() > 0.75 * panel.width(), pixmap.height() > 0.75 * panel.height()
    assert wide or high


def test_the_texts_stay_close_to_the_image(qtbot: QtBot) -> None:
    """Also if there is more height than the image can use, and after it was larger."""
    view = MapsView()
    qtbot.addWidget(view)
    view.show()
    view.show_panels([replace(panels(1)[0], caption="what it is")])
    for size in ((300, 700), (900, 900), (300, 400), (700, 300)):
        view.resize(*size)
        qtbot.waitUntil(partial(is_captioned, view), timeout=WAIT_MS)
