"""The advice above the views is whole."""

from PySide6.QtWidgets import QLabel, QWidget

from app.live.banner import AdviceBanner
from app.program.jobs import JobQueue
from app.widgets.layout import vbox
from gelpolight_core.base.finding import Finding


def test_an_advice_of_several_lines_is_whole_and_a_short_one_moves_nothing(qtbot):
    page, views, jobs = QWidget(), QWidget(), JobQueue("banner-test", None)
    banner = AdviceBanner(jobs, idle="Idle.", on_act=lambda _name: None, over=views)
    vbox(banner, (views, 1), of=page, margins=0)
    qtbot.addWidget(page)
    page.resize(400, 300)
    page.show()
    qtbot.waitExposed(page)
    text = banner.findChild(QLabel, "inspect.advice")
    idle_px = views.y()
    for words, grows in (("word " * 4, False), ("word " * 20, False), ("word " * 60, True)):
        banner.advise(Finding("press", words))
        qtbot.waitUntil(lambda: text.height() >= text.heightForWidth(text.width()), timeout=5000)
        assert (views.y() > idle_px) == grows
    jobs.close()
