"""pyqtgraph's colour bar with a unit, the theme's colours and a histogram next to the colours."""

from __future__ import annotations

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import Signal
from PySide6.QtGui import QColor, QFont, QTransform

from app.widgets import theme
from gelpolight_core.base.compared_quantity import unit_behind
from gelpolight_core.reconstruction.height_map import Flag, HeightMap

BAR_PX, HISTOGRAM_PX, AXIS_PX, UNIT_PX = 12, 10, 38, 16
TEXT_FILL = [(0, 0.8), (2, 0.5), (3, 0.35), (5, 0.15)]
"""Labels are added while they fill no more than this share of an axis: (labels so far, share)."""
ROUNDING = 0.01
"""A dragged end is a multiple of this."""
BINS = 64
_THIN = 8
_LOW_HANDLE, _HIGH_HANDLE, _WHOLE = 63.0, 191.0, 256.0
"""pyqtgraph's fixed coordinates of its two handles, and the height of its colour image.

The view is cut to what is between the handles, so that they are at the ends of the colours.
"""
_HANDLE_COLOURS = "#ffffff", "#14171a"
"""All colour maps are dark at the low end and light at the high end."""


class ColourBar(pg.ColorBarItem):  # type: ignore[misc]
    """Shows the value of each colour, and next to it how often each value occurs.

    Parameters
    ----------
    limits : (low, high), optional
        The ends can be dragged within these. By default they cannot be dragged.

    Signals
    -------
    range_dragged(float, float)
        The ends were dragged to these values.
    """

    range_dragged = Signal(float, float)

    def __init__(self, limits: tuple[float, float] | None = None) -> None:
        super().__init__(
            width=BAR_PX,
            interactive=limits is not None,
            limits=limits,
            rounding=ROUNDING,
            colorMapMenu=False,
        )
        self._colours, self._unit = "", ""
        self._has_histogram = False
        self._histogram = pg.BarGraphItem(x0=[], x1=[], y0=[], y1=[], pen=None)
        self.addItem(self._histogram)
        self.setRange(xRange=(0.0, 1.0), yRange=(_LOW_HANDLE, _HIGH_HANDLE), padding=0)
        self.bar.setPos(0.0, _LOW_HANDLE)
        self.bar.setTransform(QTransform.fromScale(1.0, (_HIGH_HANDLE - _LOW_HANDLE) / _WHOLE))
        self.layout.setContentsMargins(6, 0, 0, 6)
        self.layout.setSpacing(0)
        for side in ("left", "top", "bottom"):
            self.hideAxis(side)
        self.axis.setWidth(AXIS_PX)
        self.axis.enableAutoSIPrefix(False)
        self.axis.setStyle(
            maxTickLevel=1, maxTextLevel=1, tickTextOffset=3, textFillLimits=TEXT_FILL
        )
        self._label = pg.LabelItem(justify="left")
        self.layout.addItem(self._label, 0, 2)
        self.layout.setRowFixedHeight(0, UNIT_PX)
        if self.region is not None:
            self._mark_handles()
        self.sigLevelsChanged.connect(lambda _bar: self.range_dragged.emit(*self.values))

    @property
    def dragged(self) -> bool:
        """Whether the user is dragging an end now."""
        region = self.region
        return region is not None and (region.moving or any(line.moving for line in region.lines))

    def show_range(
        self, colours: str, low: float, high: float, unit: str, *, factor: float = 1.0
    ) -> None:
        """Show the colours from `low` to `high`, except while the user drags them.

        Parameters
        ----------
        colours : str
            Name of the colour map.
        low, high : float
            Values of the first and the last colour.
        unit : str
            Unit of the numbers on the axis.
        factor : float, optional
            The numbers on the axis are the values times this.
        """
        self.setVisible(True)
        if colours != self._colours:
            self._colours = colours
            self.setColorMap(colours)
        if unit != self._unit:
            self._unit = unit
            self._write_unit()
        self.axis.setScale(factor)
        # A single value gives no scale.
        high = high if high > low else low + 1.0
        if not self.dragged and (low, high) != self.values:
            self.setLevels((low, high))

    def show_histogram(self, counts: NDArray[np.intp]) -> None:
        """Show counts of equal parts of the range, from low to high.

        The largest count is mostly the bare membrane: its bar is cut at the second largest.
        """
        share = HISTOGRAM_PX / BAR_PX
        if not self._has_histogram:
            self._has_histogram = True
            self.layout.setColumnFixedWidth(1, BAR_PX + HISTOGRAM_PX)
            self.setXRange(-share, 1.0, padding=0)
        length = np.minimum(counts / max(float(np.sort(counts)[-2]), 1.0), 1.0)
        edges = np.linspace(_LOW_HANDLE, _HIGH_HANDLE, counts.size + 1)
        self._histogram.setOpts(
            x0=-share * length, x1=np.zeros(counts.size), y0=edges[:-1], y1=edges[1:]
        )

    def apply_theme(self, font: QFont) -> None:
        """Draw in the colours of the current theme."""
        for pen in (self.axis.setPen, self.axis.setTextPen):
            pen(theme.colour("text"))
        self.axis.setStyle(tickFont=font)
        self._label.setAttr("size", f"{font.pointSize()}pt")
        self._histogram.setOpts(brush=theme.colour("muted"))
        self._write_unit()

    def _mark_handles(self) -> None:
        for line, colour in zip(self.region.lines, _HANDLE_COLOURS, strict=True):
            line.setPen(pg.mkPen(colour, width=1))
            line.setHoverPen(pg.mkPen(colour, width=3))
            line.clearMarkers()
            line.addMarker("<|>", 0.5, size=10)
        self.region.setHoverBrush(QColor(255, 255, 255, 40))

    def _write_unit(self) -> None:
        self._label.setText(unit_behind(self._unit).strip(), color=theme.colour("text"))


def depth_counts(heightmap: HeightMap, range_mm: tuple[float, float]) -> NDArray[np.intp]:
    """Return how many nodes of the thinned map have each depth, (BINS,), from low to high.

    Values outside the range are counted at its ends, as they have the colours of the ends.
    """
    measured = (heightmap.flags[::_THIN, ::_THIN] & np.uint8(Flag.OUTSIDE)) == 0
    some = heightmap.depth_mm[::_THIN, ::_THIN]
    some = np.clip(some[measured & np.isfinite(some)], *range_mm)
    return np.histogram(some, BINS, range_mm)[0]
