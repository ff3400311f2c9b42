"""The cross-section: depth along the line, and what is read off it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import QEvent, Signal
from PySide6.QtGui import QColor
from PySide6.QtWidgets import (
    QCheckBox,
    QDoubleSpinBox,
    QHBoxLayout,
    QLabel,
    QPushButton,
    QVBoxLayout,
    QWidget,
)

from app.inspect.cuts import Cut, Section
from app.shell import theme
from app.widgets.naming import named
from app.widgets.plots import without_menus
from gelpolight_core.measurement.measured import Measured
from gelpolight_core.translation import tr

CURVE = "#d6249f"
FIRST, SECOND = QColor(11, 92, 173, 60), QColor(23, 138, 70, 60)
DEG = "deg"
LEAST_SPAN_MM = 0.05


class SectionPanel(QWidget):
    """Shows the profile with two ranges to be compared.

    Signals
    -------
    changed()
        A range, the width, or whether the rectangle is measured has changed.
    save_wanted()
        The profile shall be written to a file.
    """

    changed = Signal()
    save_wanted = Signal()

    def __init__(self) -> None:
        super().__init__()
        named(self, "inspect.section", tr("Cross-section"))
        self._length = 12.0
        self.cut = Cut()
        self._make_plot()
        self._width = named(
            QDoubleSpinBox(), "inspect.section.width", tr("Width"),
            tr("Depth is averaged over this width across the line"),
        )  # fmt: skip
        self._width.setRange(0.0, 5.0)
        self._width.setSingleStep(0.1)
        self._width.setValue(Section().width_mm)
        self._width.setSuffix(tr(" mm wide"))
        self._width.valueChanged.connect(self.changed)
        self._region = named(
            QCheckBox(tr("Roughness")), "inspect.section.region", tr("Measure the roughness"),
            tr("Sa, Sq and Sz in a rectangle on the height map"),
        )  # fmt: skip
        self._region.toggled.connect(self.changed)
        save = named(
            QPushButton(tr("Save profile…")), "inspect.section.save", tr("Save the profile"),
            tr("As a table (CSV)"),
        )  # fmt: skip
        save.clicked.connect(self.save_wanted)
        self._figures = named(QLabel(), "inspect.section.figures", tr("Measured"))
        self._figures.setWordWrap(True)
        self._figures.setMinimumWidth(180)
        side = QVBoxLayout()
        for widget in (self._width, self._region, self._figures):
            side.addWidget(widget)
        side.addStretch(1)
        side.addWidget(save)
        row = QHBoxLayout(self)
        row.setContentsMargins(2, 2, 6, 4)
        row.addWidget(self._plot, 1)
        row.addLayout(side)

    def _make_plot(self) -> None:
        self._plot = without_menus(
            pg.PlotWidget(viewBox=pg.ViewBox(enableMenu=False), background=None)
        )
        named(self._plot, "inspect.section.plot", tr("Depth along the line"))
        self._plot.setMinimumHeight(90)
        self._plot.setLabel("bottom", tr("along the line (mm)"))
        self._plot.setLabel("left", tr("depth (mm)"))
        for side in ("bottom", "left"):
            self._plot.getAxis(side).enableAutoSIPrefix(False)
        self._plot.showGrid(x=True, y=True, alpha=0.2)
        self._plot.hideButtons()
        self._plot.setMouseEnabled(x=False, y=False)
        self._curve = self._plot.plot(pen=pg.mkPen(CURVE, width=2))
        self._ranges = []
        for brush, share in ((FIRST, Section().first), (SECOND, Section().second)):
            region = pg.LinearRegionItem(
                [share[0] * self._length, share[1] * self._length], brush=brush
            )
            region.sigRegionChanged.connect(self.changed)
            self._plot.addItem(region)
            self._ranges.append(region)
        self._take_theme()

    @property
    def width_mm(self) -> float:
        """Over which depth is averaged."""
        return float(self._width.value())

    @property
    def has_region(self) -> bool:
        """Whether the roughness of the rectangle is measured."""
        return self._region.isChecked()

    @property
    def ranges(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """The two ranges, as shares of the line's length."""
        first, second = (sorted(item.getRegion()) for item in self._ranges)
        return self._shares(first), self._shares(second)

    def _shares(self, ends: Sequence[float]) -> tuple[float, float]:
        low, high = (min(max(v / self._length, 0.0), 1.0) for v in ends)
        return low, high

    def show_cut(self, cut: Cut) -> None:
        """Show what was measured of a frame."""
        self.cut = cut
        if cut.profile is None:
            self._curve.setData([], [])
        else:
            along, depth = cut.profile.along_mm, cut.profile.depth_mm
            self._follow_length(float(along[-1]))
            self._curve.setData(along, depth)
            self._fit(depth)
        self._figures.setText("<br>".join([*figure_lines(cut.figures), *cut.sentences]))

    def _follow_length(self, length: float) -> None:
        """Keep the ranges at their shares of a line that became longer or shorter."""
        if abs(length - self._length) < 1e-6:
            return
        shares = self.ranges
        self._length = length
        for item, (low, high) in zip(self._ranges, shares, strict=True):
            item.blockSignals(True)
            item.setRegion([low * length, high * length])
            item.setBounds([0.0, length])
            item.blockSignals(False)
        self._plot.setXRange(0.0, length, padding=0.02)

    def _fit(self, depth: np.ndarray) -> None:
        """Follow the depth's range, in steps that do not tremble with the noise."""
        low, high = float(np.nanmin(depth)), float(np.nanmax(depth))
        span = max(high - low, LEAST_SPAN_MM)
        (shown_low, shown_high) = self._plot.getViewBox().viewRange()[1]
        fits = shown_low <= low and shown_high >= high and shown_high - shown_low < 1.6 * span
        if not fits:
            self._plot.setYRange(low - 0.12 * span, high + 0.12 * span, padding=0.0)

    def changeEvent(self, event: QEvent) -> None:  # noqa: D102
        super().changeEvent(event)
        if event.type() == QEvent.Type.PaletteChange and hasattr(self, "_ranges"):
            self._take_theme()

    def _take_theme(self) -> None:
        pen = theme.colour("text")
        for side in ("left", "bottom"):
            axis = self._plot.getAxis(side)
            axis.setPen(pen)
            axis.setTextPen(pen)


def figure_lines(figures: Sequence[Measured]) -> list[str]:
    """Return measured values as lines; the slopes of the two ranges are told apart."""
    lines, seen = [], 0
    for figure in figures:
        where = ""
        if figure.name == "slope":
            where = (tr(" (blue)"), tr(" (green)"))[seen % 2]
            seen += 1
        lines.append(figure_text(figure, where))
    return lines


def figure_text(figure: Measured, where: str = "") -> str:
    """Return a measured value with its unit and standard deviation."""
    unit = "°" if figure.unit == DEG else f" {figure.unit}"
    digits = {"mm": 3, "um": 1}.get(figure.unit, 1)
    sd = "" if figure.sd is None else f" ± {figure.sd:.{digits}f}"
    return f"{figure.label}{where}: <b>{figure.value:.{digits}f}{sd}{unit}</b>"
