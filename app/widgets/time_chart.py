"""A chart of values over time, with their limits."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from datetime import timedelta

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QEvent, Qt
from PySide6.QtWidgets import QWidget

from app.theme import theme
from app.widgets.layout import vbox
from app.widgets.naming import named
from app.widgets.plots import apply_theme, bare_plot


@dataclass(frozen=True, slots=True)
class Series:
    """Values of one kind.

    Attributes
    ----------
    name : str
        In the legend.
    times_s, values : sequence of float
        Seconds since 1970-01-01 (UTC), and the values.
    limit : float
        Drawn above and below 0.
    colours : (str, str)
        In the light and the dark theme.
    symbol : str
        Of a point, so that colours are not all that tells series apart.
    half_bars : sequence of float
        Half the length of the error bars; empty for none.
    line : (sequence of float, sequence of float)
        Times and values of a line; by default the points are connected.
    """

    name: str
    times_s: Sequence[float]
    values: Sequence[float]
    limit: float
    colours: tuple[str, str]
    symbol: str
    half_bars: Sequence[float] = ()
    line: tuple[Sequence[float], Sequence[float]] | None = None


class TimeChart(QWidget):
    """Shows series of values in the colours of the theme.

    Parameters
    ----------
    name, title : str
        Object name, and its text for screen readers.

    Attributes
    ----------
    shown : tuple of Series
        What it shows.
    """

    def __init__(self, name: str, title: str) -> None:
        super().__init__()
        named(self, name, title)
        self.shown: tuple[Series, ...] = ()
        self._unit = ""
        self._plot = bare_plot(bottom=pg.DateAxisItem())
        # One value alone shows its day.
        self._plot.setLimits(minXRange=timedelta(days=1).total_seconds())
        self._legend = self._plot.addLegend(offset=(8, 8))
        vbox(self._plot, of=self, margins=0)
        self._draw()

    def show_series(self, series: Sequence[Series], unit: str) -> None:
        """Show these series, and nothing else; `unit` names the vertical axis."""
        self.shown, self._unit = tuple(series), unit
        self._draw()
        self._plot.autoRange()

    def changeEvent(self, event: QEvent) -> None:
        """Apply the colours of a new theme."""
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "_legend"):
            self._draw()

    def _draw(self) -> None:
        self._plot.clear()
        apply_theme(self._plot)
        self._plot.setLabel("left", self._unit)
        self._legend.setLabelTextColor(theme.colour("text"))
        self._plot.addItem(pg.InfiniteLine(0.0, angle=0, pen=theme.colour("line")))
        for series in self.shown:
            colour = series.colours[theme.is_dark()]
            thin, x = pg.mkPen(colour), series.times_s
            points = {"symbol": series.symbol, "symbolBrush": colour, "symbolPen": colour}
            pen = thin if series.line is None else None
            self._plot.plot(x, series.values, name=series.name, pen=pen, symbolSize=8, **points)
            if series.line is not None:
                self._plot.plot(*series.line, pen=pg.mkPen(colour, width=2))
            if len(series.half_bars):
                ends = {"x": np.array(x), "y": np.array(series.values)}
                height = 2.0 * np.array(series.half_bars)
                self._plot.addItem(pg.ErrorBarItem(**ends, height=height, pen=thin))
            dashed = pg.mkPen(colour, style=Qt.PenStyle.DashLine)
            for limit in (-series.limit, series.limit):
                self._plot.addItem(pg.InfiniteLine(limit, angle=0, pen=dashed))
