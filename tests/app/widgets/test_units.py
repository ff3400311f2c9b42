"""The unit in which measured lengths are shown."""

import numpy as np
import pytest

from app.inspect.section_panel import figure_text as section_text
from app.measure.figures_text import figure_text
from app.view2d.map_point import read_at
from app.view2d.profile_plot import ProfilePlot
from app.view3d.surface import ColourScale
from app.widgets.units import in_unit, use_length_unit
from gelpolight_core.measurement.measured import Measured


@pytest.fixture
def um():
    """Show lengths in um during a test."""
    use_length_unit("um")
    yield
    use_length_unit("mm")


def test_a_length_is_shown_in_the_chosen_unit(um):
    assert in_unit(0.5123) == "512.3 um"
    assert in_unit(0.5, sign="+") == "+500.0 um"
    use_length_unit("mm")
    assert in_unit(0.5123) == "0.512 mm"
    use_length_unit("furlong")
    assert in_unit(1.0) == "1.000 mm"


def test_measured_lengths_keep_their_uncertainty_and_other_units_stay(um):
    step = Measured(0.5123, 0.0021, "mm", "step_height")
    assert "512.3 ± 2.1 um" in section_text(step)
    assert "512.3 ± 2.1" in figure_text(step)
    for other in (Measured(3.2, 0.1, "um", "ra"), Measured(12.5, 0.2, "deg", "slope")):
        text = figure_text(other)
        use_length_unit("mm")
        assert figure_text(other) == text
        use_length_unit("um")


def test_readings_scales_and_axes_follow_the_unit(um, dome, qtbot):
    reading = read_at(dome, 2.0, -1.0)
    assert in_unit(reading.depth_mm) == "800.0 um" and "x 2.00" in reading.detail()
    table = np.zeros((256, 3), np.uint8)
    scale = ColourScale("depth [mm]", table, -0.1, 0.5).in_unit()
    assert (scale.title, scale.low, scale.high) == ("depth [um]", -100.0, 500.0)
    slope = ColourScale("slope [°]", table, 0.0, 60.0)
    assert slope.in_unit() is slope
    plot = ProfilePlot("plot")
    qtbot.addWidget(plot)
    plot.show_profile(None)
    assert plot.getAxis("left").scale == 1e3
