"""A sensor's error over time, with the limits, to make changes visible."""

from __future__ import annotations

import pyqtgraph as pg
from PySide6.QtCore import QEvent, Qt
from PySide6.QtWidgets import QWidget

from app.measure.judging import DEPTH_FIGURES
from app.services.preferences import Limits
from app.theme import theme
from app.widgets.layout import vbox
from app.widgets.naming import named
from app.widgets.plots import apply_theme, bare_plot
from gelpolight_core.records.entry import MeasurementRecord
from gelpolight_core.translation import tr

# (light, dark). The symbols differ, too.
PLANE = ("#0b5cad", "#74b5f7")
DEPTH = ("#a04a00", "#f2b75f")


class ErrorPlot(QWidget):
    """Errors in percent against time: in the plane, and in depth."""

    def __init__(self) -> None:
        super().__init__()
        named(self, "measure.drift", tr("Error over time"))
        self._plot = bare_plot(bottom=pg.DateAxisItem())
        self._plot.setLabel("left", tr("error (%)"))
        self._legend = self._plot.addLegend(offset=(-8, 8))
        self._series = {
            "plane": self._plot.plot([], [], symbol="o", symbolSize=8),
            "depth": self._plot.plot([], [], symbol="t", symbolSize=9),
        }
        self._limits = {
            name: [pg.InfiniteLine(0.0, angle=0) for _ in range(2)] for name in self._series
        }
        self._zero = pg.InfiniteLine(0.0, angle=0)
        self._plot.addItem(self._zero, ignoreBounds=True)
        for lines in self._limits.values():
            for line in lines:
                self._plot.addItem(line)
        self.shown: dict[str, list[tuple[float, float]]] = {}
        vbox(self._plot, of=self, margins=0)
        self._legend.addItem(self._series["plane"], tr("in the plane"))
        self._legend.addItem(self._series["depth"], tr("in depth"))
        self._colour()

    def show_records(self, records: tuple[MeasurementRecord, ...], limits: Limits) -> None:
        """Show the errors of the measurements that have a true value.

        Parameters
        ----------
        records : tuple of MeasurementRecord
            Of one sensor, in any order.
        limits : Limits
            Position of the limit lines.
        """
        found: dict[str, list[tuple[float, float]]] = {"plane": [], "depth": []}
        for record in sorted(records, key=lambda r: r.time):
            for quantity in record.quantities:
                if quantity.error_percent is not None:
                    in_depth = quantity.name.rpartition("_")[0] in DEPTH_FIGURES
                    point = (record.time.timestamp(), quantity.error_percent)
                    found["depth" if in_depth else "plane"].append(point)
        self.shown = found
        for name, points in found.items():
            self._series[name].setData([p[0] for p in points], [p[1] for p in points])
        for name, limit in (("plane", limits.size_percent), ("depth", limits.height_percent)):
            for line, value in zip(self._limits[name], (limit, -limit), strict=True):
                line.setValue(value)
        reach = max(limits.size_percent, limits.height_percent) * 1.15
        errors = [abs(p[1]) for points in found.values() for p in points]
        reach = max([reach, *(1.1 * e for e in errors)])
        self._plot.setYRange(-reach, reach, padding=0.0)
        times = [p[0] for points in found.values() for p in points]
        if times:
            margin = max(0.05 * (max(times) - min(times)), 30.0)
            self._plot.setXRange(min(times) - margin, max(times) + margin, padding=0.0)

    def changeEvent(self, event: QEvent) -> None:
        """Apply the colours of a new theme."""
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "_zero"):
            self._colour()

    def _colour(self) -> None:
        dark = theme.is_dark()
        text = theme.colour("text")
        apply_theme(self._plot)
        self._legend.setLabelTextColor(text)
        for _, label in self._legend.items:
            label.setText(label.text)  # otherwise it keeps its first colour
        self._zero.setPen(pg.mkPen(theme.colour("line")))
        for name, pair in (("plane", PLANE), ("depth", DEPTH)):
            colour = pair[dark]
            self._series[name].setPen(pg.mkPen(colour, width=1))
            self._series[name].setSymbolBrush(colour)
            self._series[name].setSymbolPen(colour)
            for line in self._limits[name]:
                line.setPen(pg.mkPen(colour, width=1, style=Qt.PenStyle.DashLine))
