"""A chart of values in the order of their times, with their limits."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from datetime import UTC, datetime

import pyqtgraph as pg
from PySide6.QtCore import QEvent, Qt
from PySide6.QtGui import QFontMetricsF
from PySide6.QtWidgets import QWidget

from app.widgets import theme

from .layout import vbox
from .plots import apply_theme, bare_plot
from .widget_names import set_names

# (light, dark)
PLANE = ("#0b5cad", "#74b5f7")
DEPTH = ("#a04a00", "#f2b75f")
"""Colours of errors in the plane and in depth. Their symbols differ, too."""


@dataclass(frozen=True, slots=True)
class ChartSeries:
    """Values of one kind.

    Attributes
    ----------
    name : str
        Name in the legend.
    times_s, values : sequence of float
        Seconds since 1970-01-01 (UTC), and the values.
    limit : float
        Drawn above and below 0.
    colours : (str, str)
        Colours in the light and the dark theme.
    symbol : str
        Symbol of the points, so that series differ not only in colour.
    """

    name: str
    times_s: Sequence[float]
    values: Sequence[float]
    limit: float
    colours: tuple[str, str]
    symbol: str


class TimeChart(QWidget):
    """Shows series of values in the colours of the theme.

    The points are evenly spaced, in the order of their times, and the axis shows the days: a clock
    that was wrong once moves its own point, and no other.

    Parameters
    ----------
    name, title : str
        Object name, and its text for screen readers.

    Attributes
    ----------
    shown : tuple of ChartSeries
        The series on the chart.
    """

    def __init__(self, name: str, title: str) -> None:
        super().__init__()
        set_names(self, name, title)
        self.shown: tuple[ChartSeries, ...] = ()
        self._days = _Days("bottom")
        self._days.setStyle(hideOverlappingLabels=False)
        self._plot = bare_plot(bottom=self._days)
        self._plot.setLimits(minXRange=1.0)  # one value alone has a range, too
        self._plot.setLabel("left", "error (%)")
        self._legend = self._plot.plotItem.legend = pg.LegendItem(colCount=2)
        self._plot.plotItem.layout.addItem(self._legend, 4, 1)  # below the axis: it hides no point
        vbox(self._plot, of=self, margins=0)
        self._draw()

    def show_series(self, series: Sequence[ChartSeries]) -> None:
        """Show these series, and nothing else."""
        self.shown = tuple(series)
        self._draw()
        self._plot.autoRange(padding=0.1)  # so that the first and the last day have room

    def changeEvent(self, event: QEvent) -> None:
        """Apply the colours of a new theme."""
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "_legend"):
            self._draw()

    def _draw(self) -> None:
        self._plot.clear()
        apply_theme(self._plot)
        self._legend.setLabelTextColor(theme.colour("text"))
        self._plot.addItem(pg.InfiniteLine(0.0, angle=0, pen=theme.colour("line")))
        times = sorted({time for series in self.shown for time in series.times_s})
        self._days.show_times(times)
        for series in self.shown:
            colour = series.colours[theme.is_dark()]
            x = [times.index(time) for time in series.times_s]
            points = {"symbol": series.symbol, "symbolBrush": colour, "symbolPen": colour}
            pen = pg.mkPen(colour)
            self._plot.plot(x, series.values, name=series.name, pen=pen, symbolSize=8, **points)
            dashed = pg.mkPen(colour, style=Qt.PenStyle.DashLine)
            for limit in (-series.limit, series.limit):
                self._plot.addItem(pg.InfiniteLine(limit, angle=0, pen=dashed))


class _Days(pg.AxisItem):  # type: ignore[misc]
    """Shows the day of some of the points, as many as there is room for."""

    def show_times(self, times_s: Sequence[float]) -> None:
        """Show the times of these points, as hours if all are of one day."""
        times = [datetime.fromtimestamp(time, UTC).astimezone() for time in times_s]
        form = "%Y-%m-%d" if len({time.date() for time in times}) > 1 else "%H:%M"
        self._texts = [time.strftime(form) for time in times]
        self.picture = None
        self.update()

    def tickValues(self, low: float, high: float, size: float) -> list[tuple[float, list[int]]]:
        """Return the numbers of the points that are named."""
        width = QFontMetricsF(self.font()).horizontalAdvance("0000-00-00    ")
        step = max(math.ceil((high - low) * width / size), 1)
        last = min(math.floor(high), len(self._texts) - 1)
        return [(step, list(range(step * math.ceil(max(low, 0.0) / step), last + 1, step)))]

    def tickStrings(self, values: Sequence[int], _scale: float, _spacing: float) -> list[str]:
        """Return their days."""
        return [self._texts[value] for value in values]
