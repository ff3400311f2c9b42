"""Depth along a line, with the level and the ends of the measured width."""

from __future__ import annotations

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QEvent, Qt, Signal

from app.theme import theme
from app.widgets.naming import named
from app.widgets.plots import without_menus
from app.widgets.units import length_unit, per_mm, unit_word
from gelpolight_core.measurement.profile import Profile
from gelpolight_core.translation import tr

CURVE = "#d6249f"
LEVEL = "#d97a00"
LEAST_SPAN_MM = 0.05


class ProfilePlot(pg.PlotWidget):  # type: ignore[misc]
    """Shows a profile.

    Signals
    -------
    level_dragged(float)
        The line of the width's level was moved to this depth, mm.
    """

    level_dragged = Signal(float)

    def __init__(self, name: str) -> None:
        super().__init__(viewBox=pg.ViewBox(enableMenu=False), background=None)
        without_menus(self)
        named(self, name, tr("Depth along the line"))
        self.setMinimumHeight(90)
        self.setLabel("bottom", tr("along the line (mm)"))
        for side in ("bottom", "left"):
            self.getAxis(side).enableAutoSIPrefix(False)
        self.showGrid(x=True, y=True, alpha=0.2)
        self.hideButtons()
        self.setMouseEnabled(x=False, y=False)
        self._curve = self.plot(pen=pg.mkPen(CURVE, width=2))
        dashed = pg.mkPen(LEVEL, width=1.5, style=Qt.PenStyle.DashLine)
        self._level = pg.InfiniteLine(angle=0, pen=dashed, hoverPen=pg.mkPen(LEVEL, width=3))
        self._level.sigDragged.connect(lambda line: self.level_dragged.emit(float(line.value())))
        self._ends = pg.ScatterPlotItem(size=9, brush=LEVEL, pen=pg.mkPen("#ffffff", width=1))
        for item in (self._level, self._ends):
            item.setVisible(False)
            self.addItem(item, ignoreBounds=True)
        self._take_theme()
        self._unit = ""
        self._take_unit()

    def allow_level(self) -> None:
        """Make the level draggable."""
        self._level.setMovable(True)

    def show_profile(self, profile: Profile | None) -> None:
        """Show a profile. None: there is none."""
        if profile is None:
            self._curve.setData([], [])
            self.show_width(None)
            return
        self._take_unit()
        self._curve.setData(profile.along_mm, profile.depth_mm)
        self._fit(profile.depth_mm)

    def show_length(self, length_mm: float) -> None:
        """Show this length of the line."""
        self.setXRange(0.0, length_mm, padding=0.02)

    def show_width(self, ends: tuple[float, float, float] | None) -> None:
        """Show the ends of a width: two positions along the line and their depth. None: hidden."""
        self._level.setVisible(ends is not None)
        self._ends.setVisible(ends is not None)
        if ends is not None:
            left, right, level = ends
            if not self._level.moving:
                self._level.setValue(level)
            self._ends.setData([left, right], [level, level])

    def _fit(self, depth: np.ndarray) -> None:
        """Follow the range of the depth in steps that do not flicker with the noise."""
        low, high = float(np.nanmin(depth)), float(np.nanmax(depth))
        span = max(high - low, LEAST_SPAN_MM)
        (shown_low, shown_high) = self.getViewBox().viewRange()[1]
        fits = shown_low <= low and shown_high >= high and shown_high - shown_low < 1.6 * span
        if not fits:
            self.setYRange(low - 0.12 * span, high + 0.12 * span, padding=0.0)

    def _take_unit(self) -> None:
        if self._unit == length_unit():
            return
        self._unit = length_unit()
        self.getAxis("left").setScale(per_mm())
        self.setLabel("left", tr("depth ({unit})").format(unit=unit_word()))

    def changeEvent(self, event: QEvent) -> None:  # noqa: D102
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "_ends"):
            self._take_theme()

    def _take_theme(self) -> None:
        self.setBackground(theme.colour("base"))
        pen = theme.colour("text")
        for side in ("left", "bottom"):
            axis = self.getAxis(side)
            axis.setPen(pen)
            axis.setTextPen(pen)
