"""How light, shift, blur and validations of a sensor change, and when a limit is reached."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QEvent, Qt
from PySide6.QtWidgets import QWidget

from app.theme import theme
from app.widgets.inputs import ComboBox
from app.widgets.label import MarkupLabel, escaped
from app.widgets.layout import vbox
from app.widgets.naming import named
from app.widgets.plots import CHANNEL_COLOURS, apply_theme, bare_plot
from gelpolight_core.lab.trend import DAY_S, Course, Sample, courses, followed
from gelpolight_core.translation import tr

SYMBOLS = "o", "t", "s"


class TrendView(QWidget):
    """A chart of one kind of values, with their lines and limits, and what follows from them.

    Attributes
    ----------
    shown : tuple of Course
        What the chart shows.
    """

    def __init__(self) -> None:
        super().__init__()
        named(self, "sensors.trend", tr("Change over time"))
        tip = tr("Changes since this calibration. Errors of validations are those of all of them")
        self.group = named(ComboBox(), "sensors.trend.group", tr("Values"), tip)
        self.shown: tuple[Course, ...] = ()
        self._samples: Sequence[Sample] = ()
        self._calibration, self._limits = "", (1.0, 1.0)
        self._plot = named(bare_plot(bottom=pg.DateAxisItem()), "sensors.trend.plot", tr("Chart"))
        self._legend = self._plot.addLegend(offset=(8, 8))
        self.words = named(MarkupLabel(wrap=True), "sensors.trend.words", tr("Drift"))
        self.words.setAlignment(Qt.AlignmentFlag.AlignTop)
        vbox(self.group, (self._plot, 1), self.words, of=self, margins=(0, 6, 0, 0), spacing=6)
        self.group.addItems(list(followed(*self._limits)))
        self.group.currentIndexChanged.connect(self._show)

    def show_trend(
        self, samples: Sequence[Sample], calibration: str, limits_percent: tuple[float, float]
    ) -> None:
        """Show what was seen of a sensor since a calibration.

        Parameters
        ----------
        samples : sequence of Sample
            Of the sensor.
        calibration : str
            Identity of the calibration.
        limits_percent : (float, float)
            Largest errors of size and height in a validation.
        """
        self._samples, self._calibration = samples, calibration
        self._limits = limits_percent
        self._show()

    def changeEvent(self, event: QEvent) -> None:
        """Apply the colours of a new theme."""
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "words"):
            self._show()

    def _show(self) -> None:
        group = tuple(followed(*self._limits).values())[self.group.currentIndex()]
        self.shown = courses(self._samples, self._calibration, group)
        self._plot.clear()
        self._legend.clear()
        self._legend.setLabelTextColor(theme.colour("text"))
        apply_theme(self._plot)
        self._plot.setLabel("left", group[0].unit)
        for course, pair, symbol in zip(self.shown, CHANNEL_COLOURS, SYMBOLS, strict=False):
            self._draw(course, pair[theme.is_dark()], symbol)
        lines = [
            f"<span style='color:@{f.verdict.value}'>{escaped(f.sentence)}</span>"
            for f in (course.finding for course in self.shown)
        ]
        nothing = tr("Nothing was seen yet. Values are kept while the live image shows no object")
        self.words.setText("<br>".join(lines) or escaped(nothing))

    def _draw(self, course: Course, colour: str, symbol: str) -> None:
        seconds = DAY_S * course.days
        points = {"symbol": symbol, "symbolSize": 7, "symbolBrush": colour, "symbolPen": colour}
        self._plot.plot(seconds, course.values, pen=None, name=course.followed.name, **points)
        bars = pg.ErrorBarItem(
            x=seconds, y=course.values, height=4.0 * course.sds, pen=pg.mkPen(colour)
        )
        self._plot.addItem(bars)
        dashed = pg.mkPen(colour, style=Qt.PenStyle.DashLine)
        for sign in (-1.0, 1.0):
            line = pg.InfiniteLine(sign * course.followed.limit, angle=0, pen=dashed)
            self._plot.addItem(line)
        if course.line is not None:
            days = np.unique([course.days[0], course.line.start_day, course.days[-1]])
            self._plot.plot(DAY_S * days, course.line.at(days), pen=pg.mkPen(colour, width=2))
