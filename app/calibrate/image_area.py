"""The centre of a step with images: live image or capture, results, and the film strip."""

from __future__ import annotations

from PySide6.QtWidgets import (
    QPushButton,
    QSizePolicy,
    QTabWidget,
    QToolButton,
    QWidget,
)

from app.calibrate.film_strip import FilmStrip
from app.calibrate.maps import MapsView, Panel
from app.live.image_checks import Rgb
from app.live.live_view import LiveView
from app.sources.stream import Stream
from app.widgets.label import PlainLabel
from app.widgets.layout import hbox, vbox
from app.widgets.meaning import make_bold, show_meaning
from app.widgets.naming import named
from gelpolight_core.translation import tr

IMAGE, RESULT = range(2)


class ImageArea(QWidget):
    """Image, result and film strip; with a message when the camera is lost."""

    def __init__(self) -> None:
        super().__init__()
        named(self, "calibrate.images", tr("Images of this step"))
        self.view = LiveView()
        self.maps = MapsView()
        self.strip = FilmStrip()
        self.tabs = named(QTabWidget(documentMode=True), "calibrate.tabs", tr("Image or result"))
        self.tabs.addTab(self.view, tr("Image"))
        self.tabs.addTab(self.maps, tr("Result"))
        # In the corner of the tabs, so that the image does not move.
        self.back_to_live = named(
            QToolButton(),
            "calibrate.back_to_live",
            tr("Back to the live image"),
            tr("Back to the live image (Esc)"),
        )
        self.tabs.setCornerWidget(self.back_to_live)
        vbox(self._build_lost(), (self.tabs, 1), self.strip, of=self, margins=0, spacing=2)
        self.show_capture_name("")

    def _build_lost(self) -> QWidget:
        self.lost = named(QWidget(), "calibrate.lost", tr("The camera is lost"))
        self.why = named(PlainLabel(wrap=True), "calibrate.lost.why", tr("Why no image arrives"))
        show_meaning(self.why, "fail")
        make_bold(self.why)
        self.why.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Minimum)
        self.reconnect = named(
            QPushButton(tr("Re&connect")), "calibrate.reconnect", tr("Open the camera again")
        )
        hbox((self.why, 1), self.reconnect, of=self.lost, margins=(8, 4, 8, 4))
        self.lost.hide()
        return self.lost

    def show_lost(self, why: str) -> None:
        """Show why no more images arrive; hide the message if the text is empty."""
        self.why.setText(why)
        self.lost.setVisible(bool(why))

    def show_capture_name(self, name: str) -> None:
        """Show the name of the shown capture; an empty name means the live image."""
        self.back_to_live.setText(
            tr("{name}: back to live (Esc)").format(name=name) if name else ""
        )
        self.back_to_live.setVisible(bool(name))

    def show_step(self, *, strip: bool, image: bool) -> None:
        """Show the parts that a step needs: the film strip, and the image or else the result."""
        self.strip.setVisible(strip)
        self.show_tab(IMAGE, image)
        self.show_tab(RESULT, not image)
        self.tabs.setCurrentIndex(IMAGE if image else RESULT)

    def show_stream(self, stream: Stream | None) -> None:
        """Show the live image."""
        self.strip.choose("")
        self.show_capture_name("")
        self.view.set_overlay(None)
        self.view.set_stream(stream)
        self.view.image.say(tr("Waiting for the first image of the camera."))

    def show_capture(self, name: str, rgb: Rgb) -> None:
        """Show a capture instead of the live image."""
        self.view.set_stream(None)
        self.view.show_image(rgb)
        self.view.set_overlay(None)
        self.strip.choose(name)
        self.show_capture_name(name)

    def show_result(self, panel: Panel) -> None:
        """Show an image of a result, and open its tab."""
        self.maps.show_panels((panel,))
        self.show_tab(RESULT, True)
        self.tabs.setCurrentIndex(RESULT)

    def show_tab(self, tab: int, on: bool) -> None:
        """Show or hide a tab; if the hidden tab is open, the other one opens."""
        if not on and self.tabs.currentIndex() == tab:
            self.tabs.setCurrentIndex(RESULT if tab == IMAGE else IMAGE)
        self.tabs.setTabVisible(tab, on)
