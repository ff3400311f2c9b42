"""A small icon next to a text. It follows the theme."""

from __future__ import annotations

from PySide6.QtGui import QIcon, QPainter, QPaintEvent
from PySide6.QtWidgets import QWidget


class Sign(QWidget):
    """Shows an icon. The text next to it has the same meaning.

    Parameters
    ----------
    icon : QIcon, optional
        An icon of :func:`app.theme.icons.icon` is redrawn when the theme changes.
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
