"""A small sign beside words; it follows the theme by itself."""

from __future__ import annotations

from PySide6.QtGui import QIcon, QPainter, QPaintEvent
from PySide6.QtWidgets import QWidget

SIDE = 18


class Sign(QWidget):
    """Shows an icon; the words beside it say the same.

    Parameters
    ----------
    icon : QIcon, optional
        One of :func:`app.shell.icons.icon` is drawn anew in every theme.
    """

    def __init__(self, icon: QIcon | None = None, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._icon = icon or QIcon()
        self.setFixedSize(SIDE, SIDE)

    def show_icon(self, icon: QIcon) -> None:
        """Show another icon."""
        self._icon = icon
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:
        """Draw the icon in the theme of now."""
        painter = QPainter(self)
        self._icon.paint(painter, self.rect())
        painter.end()
