"""Short lengths are shown in micrometres."""

from dataclasses import replace

import numpy as np

from app.inspect.section_panel import figure_text as section_text
from app.measure.figures_text import figure_text
from app.view2d.map_point import read_at
from app.view2d.profile_plot import ProfilePlot
from app.view3d.surface import ColourScale
from app.widgets.units import in_unit
from gelpolight_core.measurement.measured import Measured
from gelpolight_core.measurement.profile import take_profile


def test_a_length_below_a_tenth_of_a_mm_is_shown_in_um():
    texts = {0.5123: "0.512 mm", 0.1: "0.100 mm", 0.0512: "51.2 um", -0.0021: "-2.1 um"}
    assert {length: in_unit(length) for length in texts} == texts
    assert in_unit(0.05, sign="+") == "+50.0 um"


def test_measured_lengths_keep_their_uncertainty_and_other_units_stay():
    step = Measured(0.0123, 0.0021, "mm", "step_height")
    assert "12.3 ± 2.1 um" in section_text(step)
    assert "12.3 ± 2.1 µm" in figure_text(step)
    # A length that is not known to a tenth of a mm has no short one beside it.
    assert "0.012 ± 0.210 mm" in section_text(Measured(0.0123, 0.21, "mm", "step_height"))
    assert figure_text(Measured(3.2, 0.1, "um", "ra")) == "3.20 ± 0.10 µm"
    assert figure_text(Measured(0.05, 0.01, "deg", "slope")) == "0.050 ± 0.010°"


def test_an_axis_and_a_colour_bar_have_one_unit_for_all_numbers(dome, qtbot):
    assert "x 2.00" in read_at(dome, 2.0, -1.0).detail()
    table = np.zeros((256, 3), np.uint8)
    scale = ColourScale("depth [mm]", table, -0.01, 0.05).in_unit()
    assert (scale.title, scale.low, scale.high) == ("depth [um]", -10.0, 50.0)
    deep = ColourScale("depth [mm]", table, -0.01, 0.5).in_unit()
    assert (deep.title, deep.low, deep.high) == ("depth [mm]", -0.01, 0.5)
    slope = ColourScale("slope [°]", table, 0.0, 0.05)
    assert slope.in_unit() is slope
    plot = ProfilePlot("plot")
    qtbot.addWidget(plot)
    axis = plot.getAxis("left")
    for share, factor, unit in ((0.05, 1e3, "um"), (1.0, 1.0, "mm")):
        pressed = replace(dome, depth_mm=share * dome.depth_mm)
        plot.show_profile(take_profile(pressed, (-2.0, 0.0), (2.0, 0.0)))
        assert axis.scale == factor and unit in axis.labelText
