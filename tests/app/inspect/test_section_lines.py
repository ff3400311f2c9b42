"""The section line: how it is dragged, and what its panel shows."""

import numpy as np
import pytest
from PySide6.QtWidgets import QLabel

from app.inspect.section_panel import SectionMarks, SectionPanel
from app.views.map.profile_plot import LINE_INK
from app.views.map.sections import SectionResult, SectionSettings, measure_sections
from gelpolight_core.reconstruction.height_map import Flag, HeightMap

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
    # The start of the line, and the middle quarter of the object.
    assert sorted(parts) == [pytest.approx((0.24, 1.68)), pytest.approx((5.5, 6.5), abs=0.1)]
    (line,), _ = marks.drawn(line=True, rectangle=False, points=False, width_mm=0.2)
    assert line.role == panel._plot._curve.opts["pen"].color().name() == LINE_INK
    panel.show_cut(SectionResult())
    assert panel._plot._curve.getData()[0] is None


def _wide_press(middle_mm: float) -> HeightMap:
    """Return a press of 1 mm with flanks of 3 mm, on a working area from -6 to 7 mm."""
    away = np.abs(SIDE_MM - middle_mm)
    depth = np.broadcast_to(np.clip(1.0 - (away - 1.5) / 3.0, 0.0, 1.0), (160, 160))
    flags = np.zeros(depth.shape, np.uint8)
    flags[:, (SIDE_MM < -6.0) | (SIDE_MM > 7.0)] = Flag.OUTSIDE.value
    return HeightMap(
        depth.astype(np.float32), SIDE_MM, SIDE_MM, 0.1, None, flags, "T", "full", "press"
    )


@pytest.mark.parametrize("middle_mm", [1.0, 2.0])
def test_the_first_line_gives_the_depth_of_a_press_with_wide_flanks(marks, middle_mm):
    press = _wide_press(middle_mm)
    marks.spread(press)
    assert (marks.start_mm[0], marks.end_mm[0]) == pytest.approx((-6.0, 7.0), abs=0.11)
    settings = SectionSettings(marks.start_mm, marks.end_mm)
    step, *_ = measure_sections(press, settings, None).figures
    assert (step.name, step.value) == ("step_height", pytest.approx(1.0, abs=1e-3))


def test_a_line_that_was_dragged_stays(marks):
    marks.spread(_wide_press(1.0))
    marks.on_drag("start", (-1.0, 2.0), ended=True)
    marks.spread(_wide_press(2.0))
    assert marks.start_mm == (-1.0, 2.0)


def test_a_flat_membrane_has_no_step():
    flat = _wide_press(30.0)
    found = measure_sections(flat, SectionSettings((-5.0, 0.0), (5.0, 0.0)), None)
    assert not found.figures and not found.step_parts and found.sentences


def test_the_settings_beside_the_section_are_never_cut(qtbot):
    panel = SectionPanel(on_changed=lambda: None, on_save=lambda: None)
    qtbot.addWidget(panel)
    assert panel.minimumSizeHint().height() > panel.form.minimumSizeHint().height() > 100
