"""The chart of errors over time."""

from app.widgets import theme
from app.widgets.time_chart import PLANE, ChartSeries, TimeChart


def test_a_limit_line_does_not_cross_the_legend(qtbot):
    chart = TimeChart("chart", "Errors")
    qtbot.addWidget(chart)
    chart.show_series((ChartSeries("in the plane", (0.0,), (1.0,), 5.0, PLANE, "o"),))
    background = chart._legend.brush().color()
    assert background == theme.colour("base") and background.alpha() == 255
