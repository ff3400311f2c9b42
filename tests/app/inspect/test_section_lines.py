"""The section line: how it is dragged, and what its panel shows."""

import numpy as np
import pytest
from PySide6.QtWidgets import QLabel

from app.inspect.section_panel import SectionMarks, SectionPanel
from app.views.map.profile_plot import LINE_INK
from app.views.map.sections import SectionResult, SectionSettings, measure_sections
from gelpolight_core.reconstruction.height_map import HeightMap

SIDE_MM = np.arange(-8.0, 8.0, 0.1)


@pytest.fixture
def marks():
    return SectionMarks(lambda: None)


@pytest.mark.parametrize(
    ("handle", "expected"),
    [
        ("start", ((-1.0, 2.0), (6.0, 0.0))),
        ("middle", ((-7.0, 2.0), (5.0, 2.0))),
        ("end", ((-6.0, 0.0), (-1.0, 2.0))),
    ],
)
def test_the_line_is_moved_by_its_ends_or_as_a_whole(marks, handle, expected):
    marks.on_drag(handle, (-1.0, 2.0), ended=True)
    assert (marks.start_mm, marks.end_mm) == expected


def test_an_end_never_meets_the_other(marks):
    marks.on_drag("start", marks.end_mm, ended=True)
    assert marks.start_mm != marks.end_mm
    (line,), _ = marks.drawn(line=True, rectangle=False, points=False, width_mm=0.2)
    assert np.isfinite(line.band).all()


@pytest.mark.function("Measure along a line: step and width")
def test_a_line_across_an_object_gives_its_step_and_its_width(marks, qtbot):
    depth = np.broadcast_to(np.where(np.abs(SIDE_MM) < 2.0, 0.4, 0.1), (160, 160))
    flags = np.zeros(depth.shape, np.uint8)
    heightmap = HeightMap(
        depth.astype(np.float32), SIDE_MM, SIDE_MM, 0.1, None, flags, "T", "full", "step"
    )
    panel = SectionPanel(on_changed=lambda: None, on_save=lambda: None)
    qtbot.addWidget(panel)
    panel.resize(600, 300)
    panel.show()
    found = measure_sections(heightmap, SectionSettings(marks.start_mm, marks.end_mm), None)
    panel.show_cut(found)
    figures = {figure.name: figure.value for figure in found.figures}
    assert figures == pytest.approx({"step_height": 0.3, "width": 4.0}, abs=0.1)
    assert figures["step_height"] == pytest.approx(0.3, abs=1e-6)
    text = panel.findChild(QLabel, "inspect.section.figures").text()
    assert "0.300 mm" in text
    parts = [part.getRegion() for part in panel._plot.items() if hasattr(part, "getRegion")]
    assert sorted(parts) == [pytest.approx((0.24, 1.68)), pytest.approx((5.28, 6.72))]
    (line,), _ = marks.drawn(line=True, rectangle=False, points=False, width_mm=0.2)
    assert line.role == panel._plot._curve.opts["pen"].color().name() == LINE_INK
    panel.show_cut(SectionResult())
    assert panel._plot._curve.getData()[0] is None


def test_the_settings_beside_the_section_are_never_cut(qtbot):
    panel = SectionPanel(on_changed=lambda: None, on_save=lambda: None)
    qtbot.addWidget(panel)
    assert panel.minimumSizeHint().height() > panel.form.minimumSizeHint().height() > 100
