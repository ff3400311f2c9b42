"""A picture of the result in the window."""

import numpy as np
from PySide6.QtCore import QPoint, Qt
from PySide6.QtTest import QTest

from app.calibrate.result_plot import ResultPlot
from gelpolight_core.output.report.result_pictures import Bars, Level, Line, ResultPicture


def test_a_click_on_a_bar_opens_its_press(qtbot):
    bars = Bars(("ball_03", "ball_01", "ball_02"), (1.4, 0.9, 0.3), ("warn", "accent", "accent"))
    marks = bars, Level(1.2, "limit 1.2 %")
    plot = ResultPlot(ResultPicture("balls", "Height error", "", ("", "%"), marks))
    qtbot.addWidget(plot)
    plot.resize(600, 260)
    plot.show()
    qtbot.waitExposed(plot)
    names = []
    plot.chosen.connect(names.append)
    view = plot.plot.getViewBox()
    for x in (1.0, 0.0):
        place = view.mapViewToScene(view.viewRect().center())
        place.setX(view.mapViewToScene(QPoint(int(x), 0)).x())
        at = plot.plot.mapFromScene(place)
        QTest.mouseClick(plot.plot.viewport(), Qt.MouseButton.LeftButton, pos=at)
    assert names == ["ball_01", "ball_03"]
    assert plot.bar_at(5.0) == ""


def test_charts_begin_at_zero_and_show_their_limits(qtbot):
    depths = np.linspace(0.1, 1.5, 5)
    marks = Line(depths, depths + 1.0, "accent"), Level(8.0, "tolerance 8 %")
    plot = ResultPlot(ResultPicture("uncertainty", "U", "", ("depth (mm)", "%"), marks))
    qtbot.addWidget(plot)
    _, (low, high) = plot.plot.viewRange()
    assert low == 0.0
    assert high > 8.0
