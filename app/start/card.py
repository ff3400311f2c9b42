"""A large button with an image, a title, and lines of text."""

from __future__ import annotations

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QIcon, QPixmap
from PySide6.QtWidgets import QCommandLinkButton

from app.theme.icons import icon
from app.widgets.naming import named

IMAGE = QSize(96, 64)


class Card(QCommandLinkButton):
    """One action of the Start page.

    Parameters
    ----------
    name : str
        Object name.
    title : str
        What a click does.
    sign : str
        Name of the icon that is shown while there is no image.
    """

    def __init__(self, name: str, title: str, sign: str) -> None:
        super().__init__(title, "")
        named(self, name, title.replace("&", ""))
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self._sign = sign
        self.show_image(None)

    def say(self, text: str) -> None:
        """Show lines of text below the title."""
        self.setDescription(text)
        self.setAccessibleDescription(text)

    def show_image(self, image: QPixmap | None) -> None:
        """Show an image, or the sign."""
        none = image is None or image.isNull()
        self.setIcon(icon(self._sign) if image is None or none else QIcon(image))
        self.setIconSize(QSize(28, 28) if none else IMAGE)
