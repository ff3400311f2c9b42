"""The paper's Fig. 13 on screen: absolute errors by size and by height."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pyqtgraph as pg
from numpy.typing import NDArray
from PySide6.QtCore import QEvent, QTimer
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QGridLayout, QWidget

from app.measure.placing import kind_label
from app.theme import theme
from app.widgets.label import MarkupLabel
from app.widgets.layout import vbox
from app.widgets.naming import named
from app.widgets.plots import without_menus
from gelpolight_core.measurement.evaluation import (
    ALL,
    DIRECTIONS,
    PAPER_PERCENT,
    RANDOM,
    SAME,
    Evaluation,
    errors_by_dimension,
    region_kinds,
)
from gelpolight_core.measurement.press import Press
from gelpolight_core.translation import tr

# Colours of Okabe and Ito for the light and the dark theme. The symbols differ, too.
COLOURS = {"cylinder": ("#0072b2", "#56b4e9"), "cuboid": ("#d55e00", "#e69f00")}
SIGNS = {"cylinder": "o", "cuboid": "s"}
WORDS = {"cylinder": "\N{BLACK CIRCLE}", "cuboid": "\N{BLACK SQUARE}"}
BAR_WIDTH = 0.34
FILL_ALPHA = 110


class Fig13(QWidget):
    """Bars are means, whiskers one standard deviation, symbols the presses, dashes the paper."""

    def __init__(self) -> None:
        super().__init__()
        named(self, "protocol.figure", tr("Errors by size and height, as in the paper's Fig. 13"))
        self.legend = named(MarkupLabel(), "protocol.legend", tr("Legend"))
        self._grid = QGridLayout(spacing=6)
        vbox(self.legend, (self._grid, 1), of=self, margins=0, spacing=4)
        self._plots: list[pg.PlotWidget] = []
        self._evaluation: Evaluation | None = None
        self._repaint = QTimer(self, interval=1, singleShot=True)
        self._repaint.timeout.connect(self._draw)

    def show_evaluation(self, evaluation: Evaluation) -> None:
        """Draw an evaluation."""
        self._evaluation = evaluation
        self._draw()

    def changeEvent(self, event: QEvent) -> None:  # noqa: D102
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "_repaint"):
            # Later: Qt is walking over all widgets, and none may be created or deleted meanwhile.
            self._repaint.start()

    def _draw(self) -> None:
        evaluation = self._evaluation
        if evaluation is None:
            return
        for old in self._plots:
            self._grid.removeWidget(old)
            old.deleteLater()
        self._plots = []
        kinds = region_kinds(evaluation.results)
        series = [name for name in kinds if name != ALL] or [ALL]
        for row, name in enumerate(series):
            for column, direction in enumerate(DIRECTIONS):
                plot = self._panel(evaluation.series(direction, kinds[name]), direction, name)
                self._grid.addWidget(plot, row, column)
                self._plots.append(plot)
        parts = [
            f"<span style='color:{_colour(shape).name()}'>{WORDS[shape]}</span> {kind_label(shape)}"
            for shape in COLOURS
            if any(r.truth.shape == shape for r in evaluation.results)
        ]
        parts.append(tr("bars: mean, whiskers: one standard deviation, dashes: the paper's mean"))
        self.legend.setText("&nbsp;&nbsp;&nbsp;".join(parts))

    def _panel(self, results: Sequence[Press], direction: str, regions: str) -> pg.PlotWidget:
        plot = without_menus(
            pg.PlotWidget(viewBox=pg.ViewBox(enableMenu=False), background=theme.colour("base"))
        )
        named(plot, f"protocol.figure.{direction}.{regions.replace(' ', '_')}", regions)
        text = theme.colour("text")
        for name in ("left", "bottom"):
            plot.getAxis(name).setPen(theme.colour("line"))
            plot.getAxis(name).setTextPen(text)
            plot.getAxis(name).enableAutoSIPrefix(False)
        dimensions, bars = errors_by_dimension(results, direction)
        plot.getAxis("bottom").setTicks([[(k, f"{d:g}") for k, d in enumerate(dimensions)]])
        across = tr("diameter or side (mm)") if direction == "planar" else tr("height (mm)")
        plot.setLabel("bottom", across, color=text.name())
        plot.setLabel("left", tr("absolute error (%)"), color=text.name())
        title = tr("Planar direction") if direction == "planar" else tr("Depth direction")
        words = {SAME: tr("same region"), RANDOM: tr("random regions")}.get(regions)
        plot.setTitle(title if words is None else f"{title}, {words}", color=text.name())
        top = PAPER_PERCENT[direction]
        for (shape, place), errors in bars.items():
            centre = place + (list(SIGNS).index(shape) - 0.5) * BAR_WIDTH * 1.1
            _bar(plot, centre, errors, _colour(shape), SIGNS[shape])
            top = max(top, float(errors.max()))
        dashes = pg.mkPen(text, width=1.2, dash=[5, 4])
        plot.addItem(pg.InfiniteLine(PAPER_PERCENT[direction], angle=0, pen=dashes))
        plot.setMouseEnabled(x=False, y=False)
        plot.hideButtons()
        x_range = (-0.6, max(len(dimensions), 1) - 0.4)
        plot.setRange(xRange=x_range, yRange=(0.0, 1.1 * top), padding=0)
        return plot


def _colour(shape: str) -> QColor:
    return QColor(COLOURS[shape][theme.is_dark()])


def _bar(
    plot: pg.PlotWidget, centre: float, errors: NDArray[np.float64], colour: QColor, sign: str
) -> None:
    fill = QColor(colour)
    fill.setAlpha(FILL_ALPHA)
    mean, nothing = float(errors.mean()), pg.mkPen(None)
    plot.addItem(
        pg.BarGraphItem(x=[centre], height=[mean], width=BAR_WIDTH, brush=fill, pen=nothing)
    )
    jitter = np.zeros(1)
    if errors.size > 1:
        spread = float(errors.std(ddof=1))
        jitter = np.linspace(-0.3, 0.3, errors.size) * BAR_WIDTH
        plot.addItem(
            pg.ErrorBarItem(
                x=np.array([centre]),
                y=np.array([mean]),
                top=np.array([spread]),
                bottom=np.array([min(spread, mean)]),
                beam=0.12,
                pen=pg.mkPen(theme.colour("text"), width=1.3),
            )
        )
    plot.addItem(
        pg.ScatterPlotItem(centre + jitter, errors, symbol=sign, size=5, brush=colour, pen=nothing)
    )
