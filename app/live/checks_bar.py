"""Below and over the image: pixel under the pointer, focus, exposure, frame rate, histogram."""

from __future__ import annotations

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QProgressBar, QWidget

from app.widgets.label import CutLabel
from app.widgets.layout import hbox, keep_space
from app.widgets.plots import without_menus
from app.widgets.widget_names import set_names

from .overlay import Role
from .overlay_item import colour_of


class FocusBar(QProgressBar):
    """Sharpness of the image relative to the recent best."""

    def __init__(self) -> None:
        super().__init__()
        set_names(
            self,
            "live.focus",
            "Focus",
            "Turn the lens until the bar is full and drops in both directions",
        )
        self.setRange(0, 1000)
        self.setFixedSize(170, 18)
        # Still images have no focus to adjust; the image above must not jump because of that.
        keep_space(self)
        self.show_share(0.0)

    def show_share(self, share: float) -> None:
        """Show the focus as a share of the best, 0..1."""
        # The last third of the range takes two thirds of the bar, because fine adjustment happens
        # there.
        self.setValue(round(1000.0 * share**3))
        self.setFormat(f"Focus {100.0 * share:.0f} % of best")
        self.setAccessibleDescription(self.text())


class ChecksBar(QWidget):
    """A line over the lower edge of the image: the pixel under the pointer, else the exposure."""

    def __init__(self) -> None:
        super().__init__()
        set_names(self, "live.checks", "Image checks")
        self.focus = FocusBar()
        self._exposure = set_names(CutLabel(), "live.exposure", "Exposure")
        self._pixel = set_names(CutLabel(), "live.pixel", "Pixel under the pointer")
        self.show_pixel("")
        hbox((self._exposure, 1), (self._pixel, 1), self.focus, of=self, margins=(8, 4, 8, 4))

    def show_line(self, text: str) -> None:
        """Show the advice about the exposure, or why no images arrive."""
        self._exposure.setText(text)
        self._exposure.setVisible(bool(text) and self._pixel.isHidden())

    def show_pixel(self, text: str) -> None:
        """Show the value under the pointer instead of the exposure."""
        self._pixel.setText(text)
        self._pixel.setVisible(bool(text))
        self._exposure.setVisible(not text and bool(self._exposure.text()))


HISTOGRAM_PX = 232, 104
# Line styles distinguish the channels without colour, together with the letters.
CHANNELS: tuple[tuple[Role, str, Qt.PenStyle], ...] = (
    ("led0", "R", Qt.PenStyle.SolidLine),
    ("led1", "G", Qt.PenStyle.DashLine),
    ("led2", "B", Qt.PenStyle.DotLine),
)


class Histogram(pg.PlotWidget):  # type: ignore[misc]
    """Three lines, pixels by brightness in percent, on a logarithmic scale."""

    def __init__(self, parent: QWidget) -> None:
        background = QColor(12, 14, 18)
        super().__init__(parent, background=background, viewBox=pg.ViewBox(enableMenu=False))
        without_menus(self)
        set_names(self, "live.histogram", "Histogram")
        self.setAttribute(Qt.WidgetAttribute.WA_TransparentForMouseEvents)
        self.resize(*HISTOGRAM_PX)
        self.hideButtons()
        self.hideAxis("left")
        axis = self.getAxis("bottom")
        axis.setTicks([[(0.0, "0"), (50.0, "50"), (100.0, "100")]])
        axis.setTextPen(colour_of("info"))
        self.showGrid(x=True, alpha=0.3)
        self.setXRange(0.0, 100.0, padding=0.08)
        self.addLegend(colCount=3, offset=(4, 1), labelTextColor=colour_of("info"))
        self._curves = [
            self.plot(pen=pg.mkPen(colour_of(role), width=1.4, style=style), name=name)
            for role, name, style in CHANNELS
        ]

    def show_counts(self, counts: NDArray[np.int64] | None) -> None:
        """Show the counts (3, bins) of the channels. None: no curves."""
        if counts is None:
            counts = np.zeros((3, 1), np.int64)
        # The end of the scale, where a pixel is saturated, goes down to the axis again.
        brightness = np.append(np.linspace(0.0, 100.0, counts.shape[1]), 100.0)
        for curve, channel in zip(self._curves, counts, strict=True):
            curve.setData(brightness, np.log1p(np.append(channel, 0)))
        self.setYRange(0.0, 1.4 * max(float(np.log1p(counts.max())), 1.0), padding=0.0)
