"""Depth along a line, with the level and the ends of the measured width."""

from __future__ import annotations

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QEvent, Qt, Signal

from app.widgets.plots import apply_theme, without_menus
from app.widgets.widget_names import set_names
from gelpolight_core.base.compared_quantity import readable_unit, unit_behind
from gelpolight_core.measurement.profile import Profile

LINE_INK = "#e0309f"
"""Of the line and its curve, unlike the level, for light and dark surroundings."""
LEVEL = "#d97a00"


class ProfilePlot(pg.PlotWidget):  # type: ignore[misc]
    """Shows a profile in the colour of its line.

    Signals
    -------
    level_dragged(float)
        The line of the width's level was moved to this depth, mm.
    """

    level_dragged = Signal(float)

    def __init__(self, name: str) -> None:
        super().__init__(viewBox=pg.ViewBox(enableMenu=False), background=None)
        without_menus(self)
        set_names(self, name, "Depth along the line")
        self.setMinimumHeight(90)
        self.setLabel("bottom", "along the line (mm)")
        for side in ("bottom", "left"):
            self.getAxis(side).enableAutoSIPrefix(False)
        self.showGrid(x=True, y=True, alpha=0.2)
        self.hideButtons()
        self.setMouseEnabled(x=False, y=False)
        self.disableAutoRange()
        self._curve = self.plot(pen=pg.mkPen(LINE_INK, width=2.5))
        dashed = pg.mkPen(LEVEL, width=1.5, style=Qt.PenStyle.DashLine)
        self._level = pg.InfiniteLine(angle=0, pen=dashed, hoverPen=pg.mkPen(LEVEL, width=3))
        self._level.sigDragged.connect(lambda line: self.level_dragged.emit(float(line.value())))
        self._ends = pg.ScatterPlotItem(size=9, brush=LEVEL, pen=pg.mkPen("#ffffff", width=1))
        for item in (self._level, self._ends):
            item.setVisible(False)
            self.addItem(item, ignoreBounds=True)
        apply_theme(self)
        self._name_depth()

    def allow_level(self) -> None:
        """Make the level draggable."""
        self._level.setMovable(True)

    def show_profile(self, profile: Profile | None) -> None:
        """Show a profile. None: nothing."""
        if profile is None:
            self._curve.setData([], [])
            self.show_width(None)
            return
        self._curve.setData(profile.along_mm, profile.depth_mm)
        self.setXRange(0.0, profile.along_mm[-1], padding=0.02)
        self._fit(profile.depth_mm)

    def show_width(self, ends: tuple[float, float, float] | None) -> None:
        """Show the ends of a width: two positions along the line and their depth. None: hidden."""
        self._level.setVisible(ends is not None)
        self._ends.setVisible(ends is not None)
        if ends is not None:
            start_mm, end_mm, level = ends
            if not self._level.moving:
                self._level.setValue(level)
            self._ends.setData([start_mm, end_mm], [level, level])

    def _fit(self, depth: np.ndarray) -> None:
        """Follow the range of the depth in steps that do not flicker with the noise."""
        low, high = float(np.nanmin(depth)), float(np.nanmax(depth))
        span = max(high - low, 0.05)
        (shown_low, shown_high) = self.getViewBox().viewRange()[1]
        fits = shown_low <= low and shown_high >= high and shown_high - shown_low < 1.6 * span
        if not fits:
            self.setYRange(low - 0.12 * span, high + 0.12 * span, padding=0.0)
            self._name_depth()

    def _name_depth(self) -> None:
        """Write the depths of the visible range in one unit."""
        unit, factor = readable_unit(*self.getViewBox().viewRange()[1])
        self.getAxis("left").setScale(factor)
        self.setLabel("left", f"depth ({unit_behind(unit).strip()})")

    def changeEvent(self, event: QEvent) -> None:  # noqa: D102
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "_ends"):
            apply_theme(self)
