"""The chart of errors over time."""

from app.widgets.time_chart import PLANE, ChartSeries, TimeChart


def test_the_legend_hides_no_point_and_no_limit(qtbot):
    chart = TimeChart("chart", "Errors")
    qtbot.addWidget(chart)
    chart.resize(380, 280)
    chart.show()
    chart.show_series((ChartSeries("in the plane", (0.0,), (1.0,), 5.0, PLANE, "o"),))
    assert [label.text for _, label in chart._legend.items] == ["in the plane"]
    legend, points = chart._legend.sceneBoundingRect, chart._plot.getViewBox().sceneBoundingRect
    qtbot.waitUntil(lambda: legend().top() >= points().bottom())
    assert chart._plot.sceneRect().contains(legend())
