"""A small sign beside words; it follows the theme by itself."""

from __future__ import annotations

from PySide6.QtGui import QIcon, QPainter, QPaintEvent
from PySide6.QtWidgets import QWidget

SIDE = 18


class Sign(QWidget):
    """Shows an icon; the words beside it say the same.

    Parameters
    ----------
    icon : QIcon
        Of :func:`app.shell.icons.icon`, drawn anew whenever it is shown.
    """

    def __init__(self, icon: QIcon, parent: QWidget | None = None) -> None:
        super().__init__(parent)
        self._icon = icon
        self.setFixedSize(SIDE, SIDE)

    def paintEvent(self, event: QPaintEvent) -> None:
        """Draw the icon in the theme of now."""
        painter = QPainter(self)
        self._icon.paint(painter, self.rect())
        painter.end()
