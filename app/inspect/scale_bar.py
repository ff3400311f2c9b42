"""A length in round numbers, drawn in the corner of a map."""

from __future__ import annotations

import math

from PySide6.QtCore import QPointF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.widgets.naming import named
from gelpolight_core.translation import tr

INK = QColor(235, 238, 242)
HALO = QColor(10, 12, 15, 190)
HEIGHT = 30
MARGIN = 8


def round_length_mm(largest_mm: float) -> float:
    """Return the largest of 1, 2, 5 times a power of ten that is no longer."""
    if not (math.isfinite(largest_mm) and largest_mm > 0.0):
        return 0.0
    power = 10.0 ** math.floor(math.log10(largest_mm) + 1e-9)
    return next(k * power for k in (5.0, 2.0, 1.0) if k * power <= largest_mm * (1.0 + 1e-9))


def length_text(length_mm: float) -> str:
    """Return a length as people write it."""
    if length_mm < 0.1:
        return tr("{l:g} um").format(l=round(1e3 * length_mm, 6))
    return tr("{l:g} mm").format(l=length_mm)


def draw_bar(
    painter: QPainter,
    left: QPointF,
    right: QPointF,
    text: str,
    *,
    ink: QColor = INK,
    halo: QColor = HALO,
) -> None:
    """Draw a bar with its length, legible on any ground."""
    for colour, width in ((halo, 5.0), (ink, 2.0)):
        painter.setPen(QPen(colour, width, Qt.PenStyle.SolidLine, Qt.PenCapStyle.FlatCap))
        painter.drawLine(left, right)
    at = QPointF(left.x(), min(left.y(), right.y()) - 6.0)
    painter.setPen(halo)
    for dx, dy in ((-1, 0), (1, 0), (0, -1), (0, 1)):
        painter.drawText(at + QPointF(dx, dy), text)
    painter.setPen(ink)
    painter.drawText(at, text)


class ScaleBar(QWidget):
    """A bar of round length, at most a quarter of the view's width."""

    def __init__(self, parent: QWidget, name: str) -> None:
        super().__init__(parent)
        named(self, name, tr("Scale bar"))
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Fixed)
        self._length_mm, self._px = 0.0, 0.0

    def sizeHint(self) -> QSize:  # noqa: D102
        return QSize(200, HEIGHT)

    def follow(self, px_per_mm: float, view: QSize) -> None:
        """Follow the magnification and size of the view."""
        length = round_length_mm(0.25 * view.width() / px_per_mm) if px_per_mm > 0.0 else 0.0
        self._length_mm, self._px = length, length * px_per_mm
        self.setGeometry(
            MARGIN, view.height() - HEIGHT - MARGIN // 2, max(int(self._px) + 60, 80), HEIGHT
        )
        self.setAccessibleDescription(length_text(length))
        self.update()

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: D102
        if self._length_mm <= 0.0:
            return
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.TextAntialiasing)
        base = HEIGHT - 6.0
        draw_bar(
            painter, QPointF(2.0, base), QPointF(2.0 + self._px, base), length_text(self._length_mm)
        )
        painter.end()
