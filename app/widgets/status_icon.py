"""Small signs: an icon next to a text, which follows the theme, and one of work in progress."""

from __future__ import annotations

from PySide6.QtGui import QIcon, QPainter, QPaintEvent
from PySide6.QtWidgets import QProgressBar, QWidget

from .layout import keep_space
from .widget_names import set_names


class StatusIcon(QWidget):
    """Shows an icon. The text next to it has the same meaning.

    Parameters
    ----------
    icon : QIcon, optional
        An icon of :func:`app.widgets.icons.icon` is redrawn when the theme changes.
    """

    def __init__(self, icon: QIcon | None = None) -> None:
        super().__init__()
        self._icon = icon or QIcon()
        self.setFixedSize(18, 18)

    def show_icon(self, icon: QIcon) -> None:
        """Show another icon."""
        self._icon = icon
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        """Draw the icon in the current theme."""
        painter = QPainter(self)
        self._icon.paint(painter, self.rect())
        painter.end()


def busy_bar(name: str, accessible: str) -> QProgressBar:
    """Return a thin bar that runs while it is visible, and keeps its space while it is not."""
    bar = set_names(QProgressBar(minimum=0, maximum=0, textVisible=False), name, accessible)
    bar.setFixedHeight(4)
    bar.hide()
    keep_space(bar)
    return bar
