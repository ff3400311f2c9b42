"""Short lengths are shown in micrometres."""

from dataclasses import replace

import numpy as np
import pytest

from app.views.map.map_point import read_at
from app.views.map.profile_plot import ProfilePlot
from app.views.surface.display_surface import ColourScale
from gelpolight_core.base.compared_quantity import Quantity, value_text
from gelpolight_core.measurement.measured_value import MeasuredValue
from gelpolight_core.measurement.profile import take_profile


@pytest.mark.function("Read short lengths in micrometres")
def test_a_length_below_a_tenth_of_a_mm_is_shown_in_um():
    texts = {0.5123: "0.512 mm", 0.1: "0.100 mm", 0.0512: "51.2 µm", -0.0021: "-2.1 µm"}
    assert {length: value_text(length) for length in texts} == texts
    assert value_text(0.05, sign="+") == "+50.0 µm"
    assert value_text(-1e-9) == "0.0 µm"


def test_measured_lengths_keep_their_uncertainty_and_other_units_stay():
    step = MeasuredValue(0.0123, 0.0021, "mm", "step_height")
    assert step.text == "12.3 ± 2.1 µm"
    assert Quantity("step_height_mm", step.value, step.sd).text == step.text
    # A length that is not known to a tenth of a mm has no short one beside it.
    assert MeasuredValue(0.0123, 0.21, "mm", "step_height").text == "0.01 ± 0.21 mm"
    assert MeasuredValue(3.2, 0.1, "um", "ra").text == "3.20 ± 0.10 µm"
    assert MeasuredValue(0.05, 0.01, "deg", "slope").text == "0.050 ± 0.010°"


def test_an_axis_and_a_colour_bar_have_one_unit_for_all_numbers(dome, qtbot):
    assert "x 2.00" in read_at(dome, 2.0, -1.0).detail()
    table = np.zeros((256, 3), np.uint8)
    scale = ColourScale("depth (mm)", table, -0.01, 0.05).in_unit()
    assert (scale.title, scale.low, scale.high) == ("depth (µm)", -10.0, 50.0)
    deep = ColourScale("depth (mm)", table, -0.01, 0.5).in_unit()
    assert (deep.title, deep.low, deep.high) == ("depth (mm)", -0.01, 0.5)
    slope = ColourScale("slope (°)", table, 0.0, 0.05)
    assert slope.in_unit() is slope
    plot = ProfilePlot("plot")
    qtbot.addWidget(plot)
    axis = plot.getAxis("left")
    for share, factor, unit in ((0.05, 1e3, "µm"), (1.0, 1.0, "mm")):
        pressed = replace(dome, depth_mm=share * dome.depth_mm)
        plot.show_profile(take_profile(pressed, (-2.0, 0.0), (2.0, 0.0)))
        assert axis.scale == factor and unit in axis.labelText
