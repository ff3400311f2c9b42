"""What is shown while a page is being loaded."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QProgressBar, QVBoxLayout, QWidget

from app.widgets.label import PlainLabel
from app.widgets.naming import named
from gelpolight_core.translation import tr

WIDTH = 320


class LoadingView(QWidget):
    """A title and a bar that moves."""

    def __init__(self) -> None:
        super().__init__()
        named(self, "main.loading", tr("A page is being loaded"))
        self._text = named(PlainLabel(), "main.loading.text", tr("What is being loaded"))
        self._text.setAlignment(Qt.AlignmentFlag.AlignHCenter)
        bar = named(QProgressBar(), "main.loading.bar", tr("A page is being loaded"))
        bar.setRange(0, 0)
        bar.setFixedWidth(WIDTH)
        column = QVBoxLayout(self)
        column.setAlignment(Qt.AlignmentFlag.AlignCenter)
        column.addWidget(self._text)
        column.addWidget(bar)

    def say(self, title: str) -> None:
        """Say which page it is."""
        self._text.setText(tr("Loading {page}…").format(page=title))
