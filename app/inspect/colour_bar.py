"""What depth a colour means."""

from __future__ import annotations

import numpy as np
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QImage, QPainter, QPaintEvent
from PySide6.QtWidgets import QSizePolicy, QWidget

from app.inspect.look import colour_table
from app.inspect.scale_bar import round_length_mm
from app.shell import theme
from app.widgets.naming import named
from gelpolight_core.translation import tr

BAR = 14
TOP = 22
BOTTOM = 10


class ColourBar(QWidget):
    """A strip of the colours with depths beside it; the deepest at the top."""

    def __init__(self, name: str, accessible: str) -> None:
        super().__init__()
        named(self, name, accessible)
        self.setSizePolicy(QSizePolicy.Policy.Fixed, QSizePolicy.Policy.Expanding)
        self._shown: tuple[str, float, float, str] = ("viridis", 0.0, 1.0, tr("mm"))

    def sizeHint(self) -> QSize:  # noqa: D102
        return QSize(58, 120)

    def show_range(self, colours: str, low: float, high: float, unit: str) -> None:
        """Show colours from low to high."""
        shown = (colours, low, high, unit)
        # A range that only trembles is not painted anew.
        old = self._shown
        close = max(abs(low - old[1]), abs(high - old[2])) < 0.01 * max(high - low, 1e-9)
        if shown[::3] != old[::3] or not close:
            self._shown = shown
            self.setAccessibleDescription(f"{low:.3g} … {high:.3g} {unit}")
            self.update()

    def paintEvent(self, event: QPaintEvent) -> None:  # noqa: D102
        colours, low, high, unit = self._shown
        painter = QPainter(self)
        table = np.ascontiguousarray(colour_table(colours)[::-1])
        strip = QImage(table.data, 1, 256, 3, QImage.Format.Format_RGB888)
        height = self.height() - TOP - BOTTOM
        painter.drawImage(QRectF(4, TOP, BAR, height), strip)
        painter.setPen(theme.colour("text"))
        painter.drawText(QPointF(4, TOP - 8), unit)
        # Of one value only there is no scale: all colours mean the same.
        span = high - low if high > low else 1.0
        step = round_length_mm(span / 3.0)
        first = int(np.ceil(low / step - 1e-6))
        for number in range(first, int(np.floor(high / step + 1e-6)) + 1):
            at = TOP + height * (1.0 - (number * step - low) / span)
            painter.drawLine(QPointF(4 + BAR, at), QPointF(8 + BAR, at))
            box = QRectF(11 + BAR, at - 9, self.width() - BAR - 11, 18)
            painter.drawText(box, Qt.AlignmentFlag.AlignVCenter, f"{number * step:.5g}")
        painter.end()
