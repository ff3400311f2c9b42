"""The view shown while a page loads."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QProgressBar, QWidget

from app.widgets.label import PlainLabel
from app.widgets.layout import vbox
from app.widgets.naming import named
from gelpolight_core.translation import tr

WIDTH = 320


class LoadingView(QWidget):
    """A title and a moving progress bar."""

    def __init__(self) -> None:
        super().__init__()
        named(self, "main.loading", tr("Page is loading"))
        self._text = named(PlainLabel(), "main.loading.text", tr("Page being loaded"))
        self._text.setAlignment(Qt.AlignmentFlag.AlignHCenter)
        bar = named(QProgressBar(minimum=0, maximum=0), "main.loading.bar", tr("Page is loading"))
        bar.setFixedWidth(WIDTH)
        vbox(self._text, bar, of=self).setAlignment(Qt.AlignmentFlag.AlignCenter)

    def say(self, title: str) -> None:
        """Show the name of the page."""
        self._text.setText(tr("Loading {page}…").format(page=title))
