"""Below and over the image: pixel under the pointer, focus, exposure, frame rate, histogram."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen, QPolygonF
from PySide6.QtWidgets import QProgressBar, QSizePolicy, QWidget

from app.live.drawing import ROLE_COLOURS
from app.live.overlay import Role
from app.widgets.label import PlainLabel, plain_tip
from app.widgets.layout import hbox
from app.widgets.naming import named
from app.widgets.quality_table import SIGNS
from gelpolight_core.finding import Finding
from gelpolight_core.translation import tr


class FocusBar(QProgressBar):
    """Sharpness of the image relative to the recent best; full means as sharp as the best."""

    def __init__(self) -> None:
        super().__init__()
        named(
            self,
            "live.focus",
            tr("Focus"),
            tr("Turn the lens until the bar is full and drops in both directions"),
        )
        self.setRange(0, 1000)
        self.setFixedSize(170, 18)
        policy = self.sizePolicy()
        # Still images have no focus to adjust; the image above must not jump because of that.
        policy.setRetainSizeWhenHidden(True)
        self.setSizePolicy(policy)
        self.show_share(0.0)

    def show_share(self, share: float) -> None:
        """Show the focus as a share of the best, 0..1."""
        self.share = share
        # The last third of the range takes two thirds of the bar, because fine adjustment happens
        # there.
        self.setValue(round(1000.0 * share**3))
        self.setFormat(tr("Focus {p:.0f} % of best").format(p=100.0 * share))
        self.setAccessibleDescription(self.text())


class ChecksBar(QWidget):
    """A line over the lower edge of the image: the pixel under the pointer, else the exposure."""

    def __init__(self) -> None:
        super().__init__()
        named(self, "live.checks", tr("Image checks"))
        self.focus = FocusBar()
        self._exposure = named(PlainLabel(), "live.exposure", tr("Exposure"))
        self._pixel = named(PlainLabel(), "live.pixel", tr("Pixel under the pointer"))
        # Long texts are cut off instead of widening the window; the tooltip has all of it.
        for label in (self._exposure, self._pixel):
            label.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self._pixel.hide()
        hbox((self._exposure, 1), (self._pixel, 1), self.focus, of=self, margins=(8, 4, 8, 4))

    def show_exposure(self, exposure: Finding | None) -> None:
        """Show the advice about the exposure; None for no text."""
        self.show_line(f"{SIGNS[exposure.verdict]} {exposure.text}" if exposure else "")

    def show_line(self, text: str) -> None:
        """Show a line in place of the exposure, such as why no images arrive."""
        if text != self._exposure.text():
            self._exposure.setText(text)
            self._exposure.setToolTip(plain_tip(text))

    def show_pixel(self, text: str) -> None:
        """Show the value under the pointer instead of the exposure."""
        if text != self._pixel.text():
            self._pixel.setText(text)
            self._pixel.setVisible(bool(text))
            self._exposure.setVisible(not text)


MARGIN_PX = 6
# Line styles distinguish the channels without colour, together with the letters.
CHANNELS: tuple[tuple[Role, str, Qt.PenStyle], ...] = (
    ("led0", tr("R"), Qt.PenStyle.SolidLine),
    ("led1", tr("G"), Qt.PenStyle.DashLine),
    ("led2", tr("B"), Qt.PenStyle.DotLine),
)


class Histogram(QWidget):
    """Three lines, pixels by brightness, on a logarithmic scale."""

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        named(self, "live.histogram", tr("Histogram"))
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.resize(self.sizeHint())
        self._counts: NDArray[np.int64] | None = None

    def sizeHint(self) -> QSize:  # noqa: D102
        return QSize(232, 104)

    def show_counts(self, counts: NDArray[np.int64] | None) -> None:
        """Show counts (3, bins); None for nothing."""
        self._counts = counts
        self.update()

    def paintEvent(self, _: QPaintEvent) -> None:  # noqa: D102
        painter = QPainter(self)
        painter.setRenderHint(QPainter.RenderHint.Antialiasing)
        painter.setPen(Qt.PenStyle.NoPen)
        painter.setBrush(QColor(12, 14, 18, 190))
        painter.drawRoundedRect(QRectF(self.rect()), 5.0, 5.0)
        if self._counts is None:
            return
        plot = QRectF(self.rect()).adjusted(MARGIN_PX, 20, -MARGIN_PX - 6, -MARGIN_PX)
        painter.setPen(QPen(QColor(255, 255, 255, 60), 1.0))
        for quarter in range(5):
            x = plot.left() + 0.25 * quarter * plot.width()
            painter.drawLine(QPointF(x, plot.top()), QPointF(x, plot.bottom()))
        height = np.log1p(self._counts)
        height = height / max(float(height.max()), 1.0)
        for k, (role, _name, style) in enumerate(CHANNELS):
            self._paint_channel(painter, plot, height[k], QColor(ROLE_COLOURS[role]), style)
        self._paint_legend(painter)

    def _paint_channel(
        self,
        painter: QPainter,
        plot: QRectF,
        height: NDArray[np.float64],
        colour: QColor,
        style: Qt.PenStyle,
    ) -> None:
        bins = height.size
        points = [
            QPointF(plot.left() + plot.width() * i / (bins - 1), plot.bottom() - plot.height() * h)
            for i, h in enumerate(height)
        ]
        painter.setBrush(Qt.BrushStyle.NoBrush)
        painter.setPen(QPen(colour, 1.4, style))
        painter.drawPolyline(QPolygonF(points))
        # The end of the scale, where a pixel is saturated, is a separate bar.
        painter.setPen(QPen(colour, 3.0))
        painter.drawLine(points[-1], QPointF(points[-1].x(), plot.bottom()))

    def _paint_legend(self, painter: QPainter) -> None:
        x = float(MARGIN_PX)
        for role, name, style in CHANNELS:
            painter.setPen(QPen(QColor(ROLE_COLOURS[role]), 1.6, style))
            painter.drawLine(QPointF(x, 11.0), QPointF(x + 16.0, 11.0))
            painter.drawText(QRectF(x + 20.0, 2.0, 16.0, 18.0), Qt.AlignmentFlag.AlignCenter, name)
            x += 42.0
        painter.setPen(QColor(ROLE_COLOURS["info"]))
        text = QRectF(x, 2.0, self.width() - x - MARGIN_PX, 18.0)
        painter.drawText(text, Qt.AlignmentFlag.AlignRight, tr("0 to 100 %"))
