"""Labels: plain text for content from outside, and markup for our own.

Names, notes and messages come from files, cameras and people. Qt interprets text that looks like
HTML as HTML and would load images that it refers to. Here only markup that the program itself wrote
is interpreted.
"""

from __future__ import annotations

import html
import re

from PySide6.QtCore import QEvent, QSize
from PySide6.QtGui import QKeySequence, QPainter, QPaintEvent, Qt
from PySide6.QtWidgets import QLabel, QWidget

from app.widgets import theme

_COLOUR = re.compile(rf"@({'|'.join(theme.MEANINGS)})\b")


class _Label(QLabel):
    """A label whose text always has the same format.

    Parameters
    ----------
    text : str, optional
        The text to show.
    parent : QWidget, optional
        Parent of the label.
    wrap : bool, optional
        Whether long lines are wrapped.
    """

    FORMAT: Qt.TextFormat

    def __init__(
        self, text: str = "", parent: QWidget | None = None, *, wrap: bool = False
    ) -> None:
        super().__init__(parent)
        self.setWordWrap(wrap)
        self.setTextFormat(self.FORMAT)
        self.setText(text)


class PlainLabel(_Label):
    """Shows a text literally, even if it looks like HTML."""

    FORMAT = Qt.TextFormat.PlainText


class CutLabel(PlainLabel):
    """Shows a line that is cut where it does not fit, and all of it as the tooltip.

    Its neighbours keep their size whatever it shows.
    """

    def setText(self, text: str) -> None:
        """Show another text."""
        super().setText(text)
        self.setToolTip(plain_tip(text))

    def minimumSizeHint(self) -> QSize:  # noqa: D102
        return QSize(0, super().minimumSizeHint().height())

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: D102
        area, role, elide = self.contentsRect(), self.foregroundRole(), Qt.TextElideMode.ElideRight
        text = self.fontMetrics().elidedText(self.text(), elide, area.width())
        align, painter = int(self.alignment()), QPainter(self)
        self.style().drawItemText(
            painter, area, align, self.palette(), self.isEnabled(), text, role
        )


def placeholder(view: QWidget, text: str = "") -> PlainLabel:
    """Return a text in the middle of a view of images, for while there is none."""
    label = PlainLabel(text, view, wrap=True)
    label.setAlignment(Qt.AlignmentFlag.AlignCenter)
    label.setStyleSheet("color: #c4ccd4; background: transparent; font-size: 14px;")
    label.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
    return label


class MarkupLabel(_Label):
    """Shows HTML of the program. Insert text from outside with :func:`escaped`.

    ``@pass`` and the other names of :data:`app.widgets.theme.MEANINGS` are replaced by their
    colours, as in ``<span style='color:@pass'>``, and follow the theme.
    """

    FORMAT = Qt.TextFormat.RichText

    def setText(self, markup: str) -> None:
        """Show other markup."""
        self._markup = markup
        super().setText(_COLOUR.sub(lambda match: theme.colour(match[1]).name(), markup))

    def changeEvent(self, event: QEvent) -> None:
        """Apply the colours of a new theme, also to hyperlinks."""
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "_markup"):
            self.setText(self._markup)


def escaped(text: str) -> str:
    """Return a text escaped so that markup shows it literally."""
    return html.escape(text).replace("@", "&#64;").replace("\n", "<br>")


def plain_tip(text: str, key: str = "") -> str:
    """Return a text such that a tooltip, which has no format property, shows it literally.

    A shortcut such as ``Ctrl+O`` follows in brackets.
    """
    if key:
        text = f"{text} ({key_text(key)})"
    return Qt.convertFromPlainText(text) if Qt.mightBeRichText(text) else text


def key_text(key: str | QKeySequence) -> str:
    """Return a shortcut with the names that keys have on this system."""
    return QKeySequence(key).toString(QKeySequence.SequenceFormat.NativeText)
