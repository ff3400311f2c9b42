"""The middle of a step with pictures: live picture or capture, results, and the film strip."""

from __future__ import annotations

from PySide6.QtCore import Signal
from PySide6.QtWidgets import (
    QHBoxLayout,
    QPushButton,
    QSizePolicy,
    QTabWidget,
    QToolButton,
    QVBoxLayout,
    QWidget,
)

from app.calibrate.film_strip import FilmStrip
from app.calibrate.maps import MapsView
from app.live.live_view import LiveView
from app.widgets.label import PlainLabel
from app.widgets.meaning import make_bold, show_meaning
from app.widgets.naming import named
from gelpolight_core.translation import tr

PICTURE, RESULT = range(2)


class Pictures(QWidget):
    """Picture, result and film strip; says when the camera is lost.

    Signals
    -------
    live_wanted()
        Back from a capture to the live picture.
    reconnect_wanted()
        Open the lost camera again.
    """

    live_wanted = Signal()
    reconnect_wanted = Signal()

    def __init__(self) -> None:
        super().__init__()
        named(self, "calibrate.pictures", tr("Pictures of this step"))
        self.view = LiveView()
        self.maps = MapsView()
        self.strip = FilmStrip()
        self.tabs = named(QTabWidget(), "calibrate.tabs", tr("Picture or result"))
        self.tabs.setDocumentMode(True)
        self.tabs.addTab(self.view, tr("Picture"))
        self.tabs.addTab(self.maps, tr("Result"))
        # In the corner of the tabs, so that the picture stays where it is.
        self.looking = named(
            QToolButton(),
            "calibrate.looking",
            tr("Back to the live picture"),
            tr("Back to the live picture (Escape)"),
        )
        self.looking.clicked.connect(self.live_wanted)
        self.tabs.setCornerWidget(self.looking)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.setSpacing(2)
        column.addWidget(self._build_lost())
        column.addWidget(self.tabs, 1)
        column.addWidget(self.strip)
        self.show_looked_at("")

    def _build_lost(self) -> QWidget:
        self.lost = named(QWidget(), "calibrate.lost", tr("The camera is lost"))
        row = QHBoxLayout(self.lost)
        row.setContentsMargins(8, 4, 8, 4)
        self.why = named(PlainLabel(), "calibrate.lost.why", tr("Why no picture comes"))
        self.why.setWordWrap(True)
        show_meaning(self.why, "fail")
        make_bold(self.why)
        self.why.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Minimum)
        again = named(
            QPushButton(tr("Re&connect")), "calibrate.reconnect", tr("Open the camera again")
        )
        again.clicked.connect(self.reconnect_wanted)
        row.addWidget(self.why, 1)
        row.addWidget(again)
        self.lost.hide()
        return self.lost

    def show_lost(self, why: str) -> None:
        """Say why no more pictures come; an empty text: they do."""
        self.why.setText(why)
        self.lost.setVisible(bool(why))

    def show_looked_at(self, name: str) -> None:
        """Name the capture that is looked at; an empty name: the live picture is."""
        self.looking.setText(tr("{name}: back to live (Esc)").format(name=name) if name else "")
        self.looking.setVisible(bool(name))

    def show_tab(self, tab: int, on: bool) -> None:
        """Offer a tab, or not; the other one is shown then."""
        if not on and self.tabs.currentIndex() == tab:
            self.tabs.setCurrentIndex(RESULT if tab == PICTURE else PICTURE)
        self.tabs.setTabVisible(tab, on)
