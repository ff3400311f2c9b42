"""Labels: plain ones, for texts that others may have written, and those with markup of our own.

Names, notes and messages come from files, cameras and people. Qt takes a text that looks like
HTML for HTML, and would load pictures that it names; here only what the program itself has put
into markup is read as such.
"""

from __future__ import annotations

import html
import re

from PySide6.QtCore import QEvent
from PySide6.QtGui import Qt
from PySide6.QtWidgets import QLabel, QWidget

from app.shell import theme

_COLOUR = re.compile(rf"@({'|'.join(theme.MEANINGS)})\b")


class PlainLabel(QLabel):
    """Shows a text as it is written, whatever it looks like.

    Parameters
    ----------
    text : str, optional
        What is shown.
    parent : QWidget, optional
        Of the label.
    """

    def __init__(self, text: str = "", parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self.setTextFormat(Qt.TextFormat.PlainText)
        self.setText(text)


class MarkupLabel(QLabel):
    """Shows HTML that the program made; what others wrote goes into it by :func:`escaped`.

    ``@pass`` and the other meanings of :data:`app.shell.theme.MEANINGS` stand for their colours,
    as in ``<span style='color:@pass'>``, and follow the theme.

    Parameters
    ----------
    markup : str, optional
        What is shown.
    parent : QWidget, optional
        Of the label.
    """

    def __init__(self, markup: str = "", parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._markup = ""
        self.setTextFormat(Qt.TextFormat.RichText)
        self.setText(markup)

    def setText(self, markup: str) -> None:
        """Show other markup."""
        self._markup = markup
        super().setText(_COLOUR.sub(lambda found: theme.colour(found[1]).name(), markup))

    def changeEvent(self, event: QEvent) -> None:
        """Take the colours of another theme, those of links among them."""
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "_markup"):
            self.setText(self._markup)


def escaped(text: str) -> str:
    """Return a text such that markup shows it as it is written."""
    return html.escape(text).replace("@", "&#64;").replace("\n", "<br>")


def plain_tip(text: str) -> str:
    """Return a text such that a tool tip, which has no format, shows it as it is written."""
    return Qt.convertFromPlainText(text) if Qt.mightBeRichText(text) else text
