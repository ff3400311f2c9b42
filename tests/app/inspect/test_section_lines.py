"""Several section lines: their colours, the chosen one, and where new ones are placed."""

import numpy as np
import pytest
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QToolButton

from app.inspect.section_line import SectionMarks
from app.inspect.section_panel import SectionPanel
from app.view2d.cuts import Cut, Section, cut
from app.view2d.profile_plot import line_colour
from gelpolight_core.reconstruction.height_map import HeightMap

SIDE_MM = np.arange(-8.0, 8.0, 0.1)


@pytest.fixture
def marks():
    return SectionMarks(lambda: None, lambda: None)


def test_a_removed_number_is_given_again_and_one_line_always_remains(marks):
    marks.add()
    marks.add()
    marks.on_tool(2)
    marks.remove()
    assert ([*marks.lines], marks.chosen) == ([1, 3], 1)
    marks.add()
    assert ([*marks.lines], marks.chosen) == ([1, 2, 3], 2)
    for _ in range(5):
        marks.remove()
    assert len(marks.lines) == 1
    assert not marks.may_remove


@pytest.mark.parametrize(
    ("grip", "expected"),
    [
        ("start", ((-1.0, 2.0), (6.0, 0.0))),
        ("middle", ((-7.0, 2.0), (5.0, 2.0))),
        ("end", ((-6.0, 0.0), (-1.0, 2.0))),
    ],
)
def test_a_line_is_moved_by_its_ends_or_as_a_whole(marks, grip, expected):
    marks.on_drag(grip, (-1.0, 2.0), ended=True)
    assert (marks.lines[1].start_mm, marks.lines[1].end_mm) == expected


def test_each_curve_has_the_colour_of_its_line_and_the_values_are_of_the_chosen_one(marks, qtbot):
    depth = np.broadcast_to(np.where(SIDE_MM < 0.0, 0.1, 0.4)[:, None], (160, 160))
    flags = np.zeros(depth.shape, np.uint8)
    heightmap = HeightMap(
        depth.astype(np.float32), SIDE_MM, SIDE_MM, 0.1, None, flags, "T", "full", "step"
    )
    panel = SectionPanel(marks, on_changed=lambda: None, on_save=lambda: None)
    qtbot.addWidget(panel)
    panel.resize(600, 300)
    panel.show()
    add = panel.findChild(QToolButton, "inspect.section.line.add")
    qtbot.mouseClick(add, Qt.MouseButton.LeftButton)
    marks.on_tool(1)
    marks.on_drag("middle", (0.0, -3.0), ended=True)
    for number, expected in ((1, 0.1), (2, 0.4)):
        marks.on_tool(number)
        panel.choice.refresh()
        panel.show_cut(cut(heightmap, Section(tuple(marks.lines.values()), marks.chosen), None))
        assert panel.choice._box.currentData() == number
        assert float(np.median(panel.cut.profile.depth_mm)) == pytest.approx(expected)
    shown = marks.drawn(lines=True, rectangle=False, points=False, width_mm=0.2)[0]
    assert [tool.role for tool in shown] == [line_colour(tool.key) for tool in shown]
    for number, curve in panel._plot._curves.items():
        assert curve.opts["pen"].color().name() == line_colour(number)
    panel.show_cut(Cut())
    assert not panel._plot._curves
