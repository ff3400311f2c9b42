"""A large button with an image, a title, and lines of text."""

from __future__ import annotations

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QPainter, QPaintEvent, QPalette, QPixmap
from PySide6.QtWidgets import (
    QAbstractButton,
    QHBoxLayout,
    QStyle,
    QStyleOptionFocusRect,
    QVBoxLayout,
    QWidget,
)

from app.theme import theme
from app.theme.icons import icon
from app.widgets.label import PlainLabel
from app.widgets.meaning import make_bold
from app.widgets.naming import named

IMAGE = QSize(96, 64)
SIGN = QSize(28, 28)


class Card(QAbstractButton):
    """One action of the Start page.

    Parameters
    ----------
    name : str
        Object name.
    title : str
        What a click does.
    sign : str
        Name of the icon that is shown while there is no image.
    parent : QWidget
        Parent widget.
    """

    def __init__(self, name: str, title: str, sign: str, parent: QWidget) -> None:
        super().__init__(parent)
        named(self, name, title)
        self.setText(title)
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self.setCursor(Qt.CursorShape.PointingHandCursor)
        self.setAttribute(Qt.WidgetAttribute.WA_Hover)
        self._sign = sign
        self._image = PlainLabel(parent=self)
        self._image.setFixedSize(IMAGE)
        self._image.setAlignment(Qt.AlignmentFlag.AlignCenter)
        heading = PlainLabel(title.replace("&", ""), self)
        make_bold(heading)
        self._lines = PlainLabel(parent=self)
        self._lines.setWordWrap(True)
        self._lines.setAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop)
        for label in (self._image, heading, self._lines):
            label.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        words = QVBoxLayout()
        words.setSpacing(2)
        words.addStretch(1)
        words.addWidget(heading)
        words.addWidget(self._lines)
        words.addStretch(1)
        row = QHBoxLayout(self)
        row.setContentsMargins(10, 8, 12, 8)
        row.addWidget(self._image)
        row.addSpacing(6)
        row.addLayout(words, 1)
        self.show_image(None)

    def say(self, text: str) -> None:
        """Show lines of text below the title."""
        self._lines.setText(text)
        self._lines.setVisible(bool(text))
        self.setAccessibleDescription(text)
        self.updateGeometry()

    def show_image(self, image: QPixmap | None) -> None:
        """Show an image, or the sign."""
        if image is None or image.isNull():
            self._image.setPixmap(icon(self._sign).pixmap(SIGN))
            return
        self._image.setPixmap(
            image.scaled(
                IMAGE,
                Qt.AspectRatioMode.KeepAspectRatio,
                Qt.TransformationMode.SmoothTransformation,
            )
        )

    def sizeHint(self) -> QSize:
        """Return the size that the content needs."""
        return self.layout().totalSizeHint()

    def paintEvent(self, event: QPaintEvent) -> None:
        """Draw a rectangle that shows where the pointer and the focus are."""
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        over = self.underMouse() or self.isDown()
        painter.setPen(theme.colour("accent" if over else "line"))
        painter.setBrush(self.palette().color(QPalette.ColorRole.Base))
        painter.drawRoundedRect(self.rect().adjusted(0, 0, -1, -1), 6, 6)
        if self.hasFocus():
            option = QStyleOptionFocusRect()
            option.initFrom(self)
            option.rect = self.rect().adjusted(3, 3, -3, -3)
            self.style().drawPrimitive(
                QStyle.PrimitiveElement.PE_FrameFocusRect, option, painter, self
            )
