"""The centre of a step with images: live image or capture, results, and the film strip."""

from __future__ import annotations

from PySide6.QtCore import QEvent, QObject, Qt
from PySide6.QtWidgets import QFrame, QPushButton, QSizePolicy, QStackedWidget, QToolButton, QWidget

from app.calibrate.film_strip import FilmStrip
from app.calibrate.maps import MapsView
from app.calibrate.page_state import Capture, PageState, state_icon, state_word
from app.live.image_checks import Rgb
from app.live.live_view import LiveView
from app.sources.stream import Stream
from app.widgets.label import PlainLabel
from app.widgets.layout import hbox, vbox
from app.widgets.meaning import heading, make_bold, show_ground, show_meaning
from app.widgets.naming import named
from app.widgets.sign import Sign
from app.widgets.timers import timer

VERDICT_MS = 3000
VERDICT_WIDTH = 320
EDGE = 8


class ImageArea(QWidget):
    """Image, result and film strip; with a message when the camera is lost."""

    def __init__(self) -> None:
        super().__init__()
        named(self, "calibrate.images", "Images of this step")
        self.view = LiveView()
        self.maps = MapsView()
        self.strip = FilmStrip()
        self.stack = QStackedWidget()
        self.stack.addWidget(self.view)
        self.stack.addWidget(self.maps)
        vbox(self._build_lost(), (self.stack, 1), self.strip, of=self, margins=0, spacing=0)
        self.result = self._floating("calibrate.result", "Result")
        self.result.setCheckable(True)
        self.result.toggled.connect(lambda on: self.stack.setCurrentIndex(int(on)))
        self.back_to_live = self._floating("calibrate.back_to_live", "Back to the live image")
        self.verdict = Verdict(self.view)
        self.stack.installEventFilter(self)

    def _floating(self, name: str, accessible: str) -> QToolButton:
        """Return a button at the top right corner of the image: it takes no space from it."""
        button = named(QToolButton(self), name, accessible)
        button.setText(accessible)
        return button

    def eventFilter(self, watched: QObject, event: QEvent) -> bool:
        """Keep the floating buttons in their corner."""
        if event.type() in (QEvent.Type.Resize, QEvent.Type.Move, QEvent.Type.Show):
            self._place()
        return super().eventFilter(watched, event)

    def _place(self) -> None:
        right = self.stack.geometry().right() - EDGE
        for button in (self.result, self.back_to_live):
            if button.isVisibleTo(self):
                button.adjustSize()
                right -= button.width()
                button.move(right, self.stack.y() + EDGE)
                button.raise_()
                right -= EDGE
        self.verdict.place()

    def _build_lost(self) -> QWidget:
        self.lost = named(QWidget(), "calibrate.lost", "The camera is lost")
        self.why = named(PlainLabel(wrap=True), "calibrate.lost.why", "Why no image arrives")
        show_meaning(self.why, "fail")
        make_bold(self.why)
        self.why.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Minimum)
        self.reconnect = QPushButton("Re&connect")
        named(self.reconnect, "calibrate.reconnect", "Open the camera again")
        hbox((self.why, 1), self.reconnect, of=self.lost, margins=(8, 4, 8, 4))
        self.lost.hide()
        return self.lost

    def show_page(self, page: PageState, before: PageState) -> None:
        """Show another state of the page: captures, the shown one, and images of the result."""
        if page.step is not before.step:
            self.verdict.hide()
            self.result.setChecked(False)
        self.lost.setVisible(bool(page.lost))
        self.why.setText(page.lost)
        self.strip.setVisible(bool(page.step.folder))
        if page.captures is not before.captures:
            self.strip.show_captures(page.captures)
        if page.panels is not before.panels:
            self.maps.show_panels(page.panels)
            if not page.panels:
                self.result.setChecked(False)
        self.result.setVisible(bool(page.panels))
        back = f"{page.shown}: back to live (Esc)"
        self.back_to_live.setText(back if page.shown else "")
        self.back_to_live.setVisible(bool(page.shown))
        if page.panels is not before.panels or page.shown != before.shown:
            self._place()

    def show_stream(self, stream: Stream | None) -> None:
        """Show the live image."""
        self.strip.choose("")
        self.view.set_overlay(None)
        self.view.set_stream(stream)
        self.view.image.say("Waiting for the first image of the camera.")

    def show_capture(self, name: str, rgb: Rgb) -> None:
        """Show a capture instead of the live image."""
        self.view.set_stream(None)
        self.view.show_image(rgb)
        self.view.set_overlay(None)
        self.strip.choose(name)


class Verdict(QFrame):
    """A card over the image that says for a moment how a new capture was judged.

    Parameters
    ----------
    view : QWidget
        The image.
    """

    def __init__(self, view: QWidget) -> None:
        super().__init__(view)
        named(self, "card", "Verdict on the new capture")
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self._view, self._sign = view, Sign()
        self.title = named(heading(""), "calibrate.verdict", "Verdict on the new capture")
        self._why = PlainLabel(wrap=True)
        vbox(
            hbox(self._sign, (self.title, 1), margins=0), self._why, of=self, margins=12, spacing=4
        )
        self.setFixedWidth(VERDICT_WIDTH)
        self._end = timer(self, VERDICT_MS, self.hide, once=True)
        self.hide()

    def show_capture(self, capture: Capture | None) -> None:
        """Show the verdict on a capture; None: nothing."""
        if capture is None or capture.finding is None:
            self.hide()
            return
        poor, value = not capture.used or capture.state != "pass", capture.residual
        shown = capture.finding.value_text if value == value else state_word(capture.state)
        self.title.setText(f"{capture.path.stem}: {shown}")
        self._why.setText(capture.finding.sentence if poor else "")
        self._why.setVisible(poor)
        self._sign.show_icon(state_icon(capture.state))
        show_ground(self, capture.state)
        self.adjustSize()
        self.place()
        self.show()
        self.raise_()
        self._end.start()

    def place(self) -> None:
        """Stay in the middle of the lower edge of the image."""
        room = self._view.rect()
        self.move((room.width() - self.width()) // 2, room.height() - self.height() - 48)
