"""Lines on the surface in 3D."""

from __future__ import annotations

import numpy as np
from PySide6.QtGui import QColor, QImage, QPainter

from app.inspect.camera3d import PRESETS, Camera
from app.inspect.draped import DrapedLine, along, draw_line, hidden, on_surface
from app.inspect.surface import Surface, surface_of
from gelpolight_core.reconstruction.heightmap import HeightMap

SIZE = (400, 300)


def _surface(dome: HeightMap) -> Surface:
    found = surface_of(dome, np.zeros((8, 8, 3), np.uint8))
    assert found is not None
    return found


def test_a_line_follows_the_relief(dome: HeightMap) -> None:
    surface = _surface(dome)
    places = along(((-6.0, -1.0), (6.0, -1.0)))
    points = on_surface(places, surface, 2.0)
    assert len(points) == len(places) > 50
    top = points[:, 2].argmax()
    assert abs(points[top, 0] - 2.0) < 0.3 and abs(points[top, 2] - 1.6) < 0.05
    assert len(on_surface(along(((-20.0, 0.0), (-15.0, 0.0))), surface, 1.0)) == 0


def test_what_stands_behind_the_relief_is_hidden(dome: HeightMap) -> None:
    surface = _surface(dome)
    behind_the_dome = np.array([[2.0, 1.0 + 4.0, 0.0]])
    before_it = np.array([[2.0, 1.0 - 4.0, 0.0]])
    low = Camera().seen_from(0.0, 8.0)
    above = Camera().seen_from(*PRESETS["top"])
    stretch = 4.0
    assert hidden(behind_the_dome, surface, low, stretch).tolist() == [True]
    assert hidden(before_it, surface, low, stretch).tolist() == [False]
    assert hidden(behind_the_dome, surface, above, stretch).tolist() == [False]


def test_a_line_is_drawn_in_its_colour(dome: HeightMap) -> None:
    image = QImage(*SIZE, QImage.Format.Format_RGB32)
    image.fill(QColor("black"))
    camera = Camera().seen_from(*PRESETS["top"]).fitted(8.0, SIZE)
    painter = QPainter(image)
    line = DrapedLine(((-5.0, 0.0), (5.0, 0.0)), "#ff0000")
    draw_line(painter, line, _surface(dome), camera, SIZE, 1.0)
    painter.end()
    middle = [image.pixelColor(200, row).red() for row in range(SIZE[1])]
    assert max(middle) > 200
