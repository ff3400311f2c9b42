"""How light, shift, blur and validations of a sensor change, and when a limit is reached."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QWidget

from app.widgets.inputs import ComboBox
from app.widgets.label import MarkupLabel, escaped
from app.widgets.layout import vbox
from app.widgets.naming import named
from app.widgets.plots import CHANNEL_COLOURS
from app.widgets.time_chart import Series, TimeChart
from gelpolight_core.lab.trend import DAY_S, Course, Sample, courses, followed

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
        named(self, "sensors.trend", "Change over time")
        tip = "Changes since this calibration. Errors of validations are those of all of them"
        self.group = named(ComboBox(), "sensors.trend.group", "Values", tip)
        self.shown: tuple[Course, ...] = ()
        self._samples: Sequence[Sample] = ()
        self._calibration, self._limits = "", (1.0, 1.0)
        self.chart = TimeChart("sensors.trend.chart", "Chart")
        self.words = named(MarkupLabel(wrap=True), "sensors.trend.words", "Drift")
        self.words.setAlignment(Qt.AlignmentFlag.AlignTop)
        vbox(self.group, (self.chart, 1), self.words, of=self, margins=(0, 6, 0, 0), spacing=6)
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

    def _show(self) -> None:
        group = tuple(followed(*self._limits).values())[self.group.currentIndex()]
        self.shown = courses(self._samples, self._calibration, group)
        parts = zip(self.shown, CHANNEL_COLOURS, SYMBOLS, strict=False)
        self.chart.show_series([_series(*part) for part in parts], group[0].unit)
        lines = [
            f"<span style='color:@{f.verdict.value}'>{escaped(f.line)}</span>"
            for f in (course.finding for course in self.shown)
        ]
        nothing = "Nothing was seen yet. Values are kept while the live image shows no object"
        self.words.setText("<br>".join(lines) or escaped(nothing))


def _series(course: Course, colours: tuple[str, str], symbol: str) -> Series:
    line: tuple[Sequence[float], Sequence[float]] = (), ()
    if course.line is not None:
        days = np.unique([course.days[0], course.line.start_day, course.days[-1]])
        line = (DAY_S * days).tolist(), course.line.at(days).tolist()
    return Series(
        course.followed.name,
        (DAY_S * course.days).tolist(),
        course.values.tolist(),
        course.followed.limit,
        colours,
        symbol,
        (2.0 * course.sds).tolist(),
        line,
    )
