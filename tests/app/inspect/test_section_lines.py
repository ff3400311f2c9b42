"""Several section lines: their colours, the chosen one, and where new ones are placed."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QToolButton
from pytestqt.qtbot import QtBot

from app.inspect.section_line import SectionLines
from app.inspect.section_panel import SectionPanel
from app.view2d.cuts import Cut, Section, cut
from app.view2d.map_view import MapView
from app.view2d.profile_plot import line_colour
from gelpolight_core.reconstruction.height_map import HeightMap

SIDE_MM = np.arange(-8.0, 8.0, 0.1)


@pytest.fixture
def lines(qtbot: QtBot) -> Iterator[SectionLines]:
    view = MapView("map", "Map")
    qtbot.addWidget(view)
    view.resize(400, 400)
    view.show()
    view.set_image(np.zeros((160, 160, 3), np.uint8), (-8.0, -8.0, 8.0, 8.0))
    yield SectionLines(view)


def numbers(lines: SectionLines) -> list[int]:
    return [line.number for line in lines]


def test_a_removed_number_is_given_again_and_one_line_always_remains(lines: SectionLines) -> None:
    lines.add()
    lines.add()
    lines.choose(2)
    lines.remove()
    assert (numbers(lines), lines.chosen) == ([1, 3], 1)
    lines.add()
    assert (numbers(lines), lines.chosen) == ([1, 2, 3], 2)
    for _ in range(5):
        lines.remove()
    assert len(numbers(lines)) == 1
    assert not lines.may_remove


def test_each_curve_has_the_colour_of_its_line_and_the_values_are_of_the_chosen_one(
    lines: SectionLines, qtbot: QtBot
) -> None:
    depth = np.broadcast_to(np.where(SIDE_MM < 0.0, 0.1, 0.4)[:, None], (160, 160))
    flags = np.zeros(depth.shape, np.uint8)
    heightmap = HeightMap(
        depth.astype(np.float32), SIDE_MM, SIDE_MM, 0.1, None, flags, "T", "full", "step"
    )
    panel = SectionPanel()
    qtbot.addWidget(panel)
    panel.resize(600, 300)
    panel.show()
    panel.choice.add_wanted.connect(lines.add)
    panel.choice.chosen.connect(lines.choose)
    lines.changed.connect(lambda: panel.choice.show_lines(lines))
    add = panel.findChild(QToolButton, "inspect.section.line.add")
    qtbot.mouseClick(add, Qt.MouseButton.LeftButton)
    lines._lines[1]._roi.setPos(0.0, -3.0)
    for number, expected in ((1, 0.1), (2, 0.4)):
        lines.choose(number)
        panel.show_cut(cut(heightmap, Section(tuple(lines), lines.chosen), None))
        assert panel.choice._box.currentData() == number
        assert panel.cut.profile is not None
        assert float(np.median(panel.cut.profile.depth_mm)) == pytest.approx(expected)
    for number, curve in panel._plot._curves.items():
        assert curve.opts["pen"].color().name() == line_colour(number)
        assert lines._lines[number]._roi.pen.color().name() == line_colour(number)
    panel.show_cut(Cut())
    assert not panel._plot._curves
