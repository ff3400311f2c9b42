"""A picture of the result in the window."""

from dataclasses import replace

import numpy as np
from PySide6.QtCore import QPoint, QPointF, Qt
from PySide6.QtGui import QWheelEvent
from PySide6.QtTest import QTest
from PySide6.QtWidgets import QApplication, QWidget

from app.calibrate.result_plot import ResultPlot
from app.widgets.label import PlainLabel
from app.widgets.layout import scroll_area, vbox
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


def test_pictures_keep_their_texts_and_heights_in_a_low_window_and_leave_the_wheel_to_the_page(
    qtbot,
):
    marks = (Line(np.arange(3.0), np.arange(3.0), "accent"),)
    picture = ResultPicture("uncertainty", "U", "A long caption. " * 12, ("depth (mm)", "%"), marks)
    plots, inside = [ResultPlot(picture), ResultPlot(replace(picture, labels=("", "")))], QWidget()
    vbox(*plots, of=inside)
    area = scroll_area(inside)
    qtbot.addWidget(area)
    area.resize(420, 200)
    area.show()
    qtbot.waitExposed(area)
    for plot, least in zip(plots, (100, 150), strict=True):
        assert plot.plot.height() >= least
        for label in plot.findChildren(PlainLabel):
            assert label.height() >= label.heightForWidth(label.width())
    viewport, at = plots[0].plot.viewport(), QPointF(80.0, 40.0)
    down, nothing = QPoint(0, -120), Qt.KeyboardModifier.NoModifier
    place, phase = viewport.mapToGlobal(at), Qt.ScrollPhase.NoScrollPhase
    button = Qt.MouseButton.NoButton
    event = QWheelEvent(at, place, QPoint(), down, button, nothing, phase, False)
    QApplication.sendEvent(viewport, event)
    assert not event.isAccepted(), "the page gets it"
