"""Diagram of error against run time, both logarithmic, with the three efforts marked."""

from __future__ import annotations

import math
from collections.abc import Sequence

import pyqtgraph as pg
from PySide6.QtCore import QEvent, QPointF, Qt
from PySide6.QtWidgets import QVBoxLayout, QWidget

from app.theme import theme
from app.widgets.naming import named
from app.widgets.plots import without_menus
from gelpolight_core.experiments.front.measure import Point, pareto_front
from gelpolight_core.translation import tr

# The paper's values for its own sensor and machine.
PAPER_MS, PAPER_PERCENT = 100.0, {"height_percent": 8.0, "size_percent": 5.0}
# (light, dark) and a shape for each family of methods.
STYLES = {
    "paper": ("#0b5cad", "#74b5f7", "o"),
    "effort": ("#1a7f37", "#57d27a", "t"),
    "precision": ("#8a3ffc", "#c9a6ff", "p"),
    "rival": ("#6b7785", "#9aa7b4", "x"),
}
LEAST = 1e-3
# Limits of the axes: times from a microsecond to a day, and the matching errors.
LIMITS = {
    "xMin": -3.0,
    "xMax": 8.0,
    "yMin": -4.0,
    "yMax": 5.0,
    "minXRange": 0.15,
    "minYRange": 0.15,
}
# Ticks within a decade, and the number of decades from which only powers of ten are marked.
MOST_STEPS, MANY_DECADES = 8, 4.0


def errors() -> dict[str, str]:
    """Return the errors that can be drawn, and their axis labels."""
    return {
        "rms_um": tr("depth, RMS (um)"),
        "height_percent": tr("height of the plateau (%)"),
        "size_percent": tr("size at half height (%)"),
        "normal_deg": tr("normals, RMS (deg)"),
    }


class PrecisionPlot(QWidget):
    """One marker per method. A line joins those that no other method beats."""

    def __init__(self) -> None:
        super().__init__()
        named(self, "precision.plot", tr("Error against processing time of a frame"))
        self._plot = without_menus(pg.PlotWidget(viewBox=pg.ViewBox(enableMenu=False)))
        self._plot.hideButtons()
        self._plot.setLogMode(x=True, y=True)
        self._plot.showGrid(x=True, y=True, alpha=0.25)
        self._plot.setLabel("bottom", tr("processing time of a frame (ms)"))
        self._plot.setLimits(**LIMITS)
        self._plot.sigRangeChanged.connect(self._set_ticks)
        for side in ("bottom", "left"):
            self._plot.getAxis(side).enableAutoSIPrefix(False)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 0, 0, 0)
        column.addWidget(self._plot)
        self._points: tuple[Point, ...] = ()
        self._error = "rms_um"
        self._draw()

    def show_points(self, points: Sequence[Point], error: str) -> None:
        """Draw one of the errors for all points that have a result."""
        self._points, self._error = tuple(points), error
        self._draw()

    def changeEvent(self, event: QEvent) -> None:  # noqa: D102
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "_error"):
            self._draw()

    def _draw(self) -> None:
        plot, dark = self._plot, theme.is_dark()
        ink = theme.colour("text")
        plot.setBackground(theme.colour("base"))
        for side in ("bottom", "left"):
            plot.getAxis(side).setPen(theme.colour("line"))
            plot.getAxis(side).setTextPen(ink)
        plot.setLabel("left", errors()[self._error])
        plot.clear()
        shown = [p for p in self._points if _coordinates(p, self._error) is not None]
        front = [p for p in pareto_front(self._points) if p in shown]
        if self._error == "rms_um" and front:
            line = pg.mkPen(ink, width=1, style=Qt.PenStyle.DashLine)
            plot.plot(*zip(*(_coordinates(p, self._error) for p in front), strict=True), pen=line)
        for point in shown:
            light, bright, symbol = STYLES.get(point.family, STYLES["rival"])
            size = 15 if point.family in ("effort", "paper") else 9
            self._mark(
                _coordinates(point, self._error),
                point.label,
                bright if dark else light,
                symbol,
                size,
            )
        if shown and self._error in PAPER_PERCENT:
            at = PAPER_MS, PAPER_PERCENT[self._error]
            self._mark(at, tr("the paper, on its own sensor"), ink.name(), "star", 15)
        plot.autoRange(padding=0.18)
        self._set_ticks()

    def _set_ticks(self) -> None:
        for side, values in zip(("bottom", "left"), self._plot.viewRange(), strict=True):
            self._plot.getAxis(side).setTicks([_ticks(*values)])

    def _mark(
        self, at: tuple[float, float] | None, text: str, colour: str, symbol: str, size: int
    ) -> None:
        assert at is not None
        self._plot.plot(
            [at[0]],
            [at[1]],
            pen=None,
            symbol=symbol,
            symbolSize=size,
            symbolBrush=colour,
            symbolPen=pg.mkPen(theme.colour("base"), width=1),
        )
        words = pg.TextItem(text, color=colour, anchor=(0.5, 1.4))
        self._plot.addItem(words, ignoreBounds=True)
        # Text is positioned in the plot's own logarithmic coordinates.
        words.setPos(_logarithm(at))


def _coordinates(point: Point, error: str) -> tuple[float, float] | None:
    """Return (ms, error), or None without a result."""
    value = getattr(point, error)
    if point.median_ms is None or value is None:
        return None
    return point.median_ms, max(value, LEAST)


def _ticks(low: float, high: float) -> list[tuple[float, str]]:
    """Return round values between two logarithms, not too many to read, with their labels."""
    if high - low < 1.0:
        least, most = 10.0**low, 10.0**high
        step = _round_up((most - least) / MOST_STEPS)
        values = [step * k for k in range(math.ceil(least / step), math.floor(most / step) + 1)]
    else:
        factors = (1, 2, 5) if high - low < MANY_DECADES else (1,)
        powers = range(math.floor(low), math.ceil(high) + 1)
        every = [factor * 10.0**power for power in powers for factor in factors]
        values = [value for value in every if low <= math.log10(value) <= high]
    return [(math.log10(value), f"{value:g}") for value in values]


def _round_up(step: float) -> float:
    """Return the next of 1, 2 and 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(step))
    return next(factor * power for factor in (1, 2, 5, 10) if factor * power >= step)


def _logarithm(at: tuple[float, float]) -> QPointF:
    return QPointF(math.log10(at[0]), math.log10(at[1]))
