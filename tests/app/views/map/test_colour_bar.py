"""The colour bar: meaning of its colours and its histogram."""

import numpy as np
import pytest
from PySide6.QtGui import QPainter, QPicture

from app.program.display import COLOUR_MAPS
from app.views.map.display import colour_table
from app.views.map.map_view import MapView


@pytest.fixture
def view(qtbot):
    made = MapView("map", "Map")
    qtbot.addWidget(made)
    made.resize(400, 300)
    made.set_image(np.zeros((20, 30, 3), np.uint8), (-3.0, -2.0, 3.0, 2.0))
    made.show()
    qtbot.waitExposed(made)
    return made


def test_the_bar_shows_the_colours_of_the_map_from_low_to_high(view):
    for colours in COLOUR_MAPS:
        view.show_colours(colours, 0.0, 1.0, "mm")
        shown = view.grab().toImage()
        box = view.bar.getViewBox().sceneBoundingRect()
        for share in (0.1, 0.5, 0.9):
            x, y = box.center().x(), box.bottom() - share * box.height()
            pixel = shown.pixelColor(round(x), round(y)).getRgb()[:3]
            expected = colour_table(colours)[round(255 * share)]
            np.testing.assert_allclose(pixel, expected, atol=8)


@pytest.mark.parametrize("height", [300, 800])
def test_every_automatic_range_is_labelled_up_to_its_end(view, qtbot, height):
    view.resize(400, height)
    for high in (0.02, 0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0):
        view.show_colours("viridis", 0.0, high, "mm")
        qtbot.wait(20)
        recorded = QPicture()
        painter = QPainter(recorded)
        _line, _ticks, texts = view.bar.axis.generateDrawSpecs(painter)
        painter.end()
        labels = [float(text) for _box, _flags, text in texts]
        assert 3 <= len(labels) <= 12
        assert min(labels) == 0.0 and max(labels) == pytest.approx(high)
