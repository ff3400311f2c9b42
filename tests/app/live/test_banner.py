"""What to do next, above the views and over them."""

import pytest
from PySide6.QtCore import QRect
from PySide6.QtWidgets import QLabel, QPushButton, QWidget

from app.live.advice import Known, LiveState, advise
from app.live.banner import Banner
from app.services.jobs import Jobs
from app.widgets.layout import vbox
from gelpolight_core.finding import Finding, Verdict

MINE, OTHER = Known("A-1", (640, 480)), Known("B-2", (640, 480))


@pytest.mark.parametrize("theirs", [(MINE,), ()])
def test_a_calibration_of_another_sensor_is_named_over_the_views_until_it_fits(theirs, qtbot):
    page, views, acts = QWidget(), QWidget(), list[str]()
    qtbot.addWidget(page)
    jobs = Jobs("banner", page)
    banner = Banner(jobs, idle="Press.", on_act=acts.append, over=views)
    vbox(banner, (views, 1), of=page)
    page.resize(600, 400)
    page.show()
    text = page.findChild(QLabel, "inspect.advice")
    button = page.findChild(QPushButton, "inspect.advised")

    def place() -> QRect:
        return QRect(text.mapTo(page, text.rect().topLeft()), text.size())

    state = LiveState("camera", "A-1", (640, 480), used=OTHER, calibrations=theirs)
    banner.advise(advise(state))
    page.resize(800, 500)
    assert "B-2" in text.text() and text.isVisible()
    assert views.geometry().contains(place())
    assert place().bottom() < views.geometry().top() + views.height() // 4
    button.click()
    assert acts == ["fitting" if theirs else "sensors"]

    banner.advise(Finding("zero", "Set to zero.", verdict=Verdict.FAIL))
    assert text.text().startswith("Set to zero")
    qtbot.waitUntil(lambda: banner.geometry().contains(place()))
    jobs.close()
