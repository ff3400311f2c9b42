"""Below and over the image: pixel under the pointer, focus, exposure, frame rate, histogram."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QPointF, QRectF, QSize, Qt
from PySide6.QtGui import QColor, QPainter, QPaintEvent, QPen, QPolygonF, QResizeEvent
from PySide6.QtWidgets import QGridLayout, QProgressBar, QSizePolicy, QWidget

from app.live.drawing import ROLE_COLOURS
from app.live.overlay import Role
from app.widgets.label import PlainLabel, plain_tip
from app.widgets.naming import named
from app.widgets.quality_table import SIGNS
from gelpolight_core.finding import Finding
from gelpolight_core.translation import tr

# Below this width the advice and the focus bar do not fit side by side.
NARROW = 620


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
    """Texts and figures about the image above: two lines, or four below a narrow one.

    The number of lines depends only on the width, so that nothing jumps when a text changes.
    """

    def __init__(self) -> None:
        super().__init__()
        named(self, "live.checks", tr("Image checks"))
        self.focus = FocusBar()
        self._exposure = named(PlainLabel(), "live.exposure", tr("Exposure"))
        self._pixel = named(PlainLabel(), "live.pixel", tr("Pixel under the pointer"))
        self._rate = named(PlainLabel(), "live.rate", tr("Frame rate"))
        self._rate.setAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        # Long texts are cut off instead of widening the window.
        self._exposure.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self._pixel.setSizePolicy(QSizePolicy.Policy.Ignored, QSizePolicy.Policy.Preferred)
        self._grid = QGridLayout(self)
        self._grid.setContentsMargins(6, 3, 6, 3)
        self._grid.setVerticalSpacing(2)
        self._grid.setColumnStretch(0, 1)
        self._narrow: bool | None = None
        self._arrange(narrow=False)

    def resizeEvent(self, event: QResizeEvent) -> None:
        """Give long advice a second line if one is too short."""
        super().resizeEvent(event)
        self._arrange(narrow=event.size().width() < NARROW)

    def _arrange(self, *, narrow: bool) -> None:
        if narrow == self._narrow:
            return
        self._narrow = narrow
        cells = {
            self._exposure: (0, 0, 1, 2) if narrow else (0, 0, 1, 1),
            self.focus: (2, 0, 1, 1) if narrow else (0, 1, 1, 1),
            self._pixel: (1, 0, 1, 2) if narrow else (1, 0, 1, 1),
            self._rate: (2, 1, 1, 1) if narrow else (1, 1, 1, 1),
        }
        for widget, cell in cells.items():
            self._grid.removeWidget(widget)
            self._grid.addWidget(widget, *cell)
        self._exposure.setWordWrap(narrow)
        lines = 2 if narrow else 1
        self._exposure.setFixedHeight(lines * self.fontMetrics().lineSpacing() + 2)

    def show_exposure(self, exposure: Finding | None) -> None:
        """Show the advice about the exposure; None for no text."""
        text = f"{SIGNS[exposure.verdict]} {exposure.text}" if exposure else ""
        if text != self._exposure.text():
            self._exposure.setText(text)
            self._exposure.setToolTip(plain_tip(text))

    def show_pixel(self, text: str) -> None:
        """Show the value under the pointer."""
        if text != self._pixel.text():
            self._pixel.setText(text)

    def show_rate(self, text: str) -> None:
        """Show the frame rate and the number of dropped frames."""
        if text != self._rate.text():
            self._rate.setText(text)
            self._rate.setToolTip(plain_tip(text))


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
