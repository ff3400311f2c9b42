"""The cross-section: depth along the line, and its measurements."""

from __future__ import annotations

from collections.abc import Sequence

import pyqtgraph as pg
from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QColor
from PySide6.QtWidgets import (
    QCheckBox,
    QFrame,
    QHBoxLayout,
    QPushButton,
    QScrollArea,
    QVBoxLayout,
    QWidget,
)

from app.inspect.line_choice import LineChoice
from app.view2d.cuts import Cut, Section
from app.view2d.profile_plot import ProfilePlot
from app.widgets.inputs import ComboBox, DoubleSpinBox
from app.widgets.label import MarkupLabel, escaped
from app.widgets.naming import named
from app.widgets.units import figure_in_unit
from gelpolight_core.measurement.measured import Measured
from gelpolight_core.translation import tr

FIRST, SECOND = QColor(11, 92, 173, 60), QColor(23, 138, 70, 60)
DEG = "deg"
SIDE_WIDTH = 170
# Those of ISO 21920-3 that fit on a sensor.
CUTOFFS_MM = (0.25, 0.8, 2.5)


class SectionPanel(QWidget):
    """Shows the profiles, with two ranges to compare, and the level of the width.

    Signals
    -------
    changed()
        A range, the width, the level, or whether the rectangle is measured has changed.
    save_wanted()
        The user wants to save the profiles.
    """

    changed = Signal()
    save_wanted = Signal()

    def __init__(self) -> None:
        super().__init__()
        named(self, "inspect.section", tr("Cross-section"))
        self._length = 12.0
        self.cut = Cut()
        self._make_plot()
        self.choice = LineChoice()
        self._width = named(
            DoubleSpinBox(), "inspect.section.width", tr("Width"),
            tr("Depth is averaged over this width across the line"),
        )  # fmt: skip
        self._width.setRange(0.0, 5.0)
        self._width.setSingleStep(0.1)
        self._width.setValue(Section().width_mm)
        self._width.setSuffix(tr(" mm wide"))
        self._width.valueChanged.connect(self.changed)
        self._region = named(
            QCheckBox(tr("Roughness")), "inspect.section.region", tr("Measure roughness"),
            tr("Measure Sa, Sq and Sz in a rectangle on the height map"),
        )  # fmt: skip
        self._region.toggled.connect(self.changed)
        self._make_level()
        self._make_cutoff()
        save = named(
            QPushButton(tr("Save…")), "inspect.section.save", tr("Save the profiles"),
            tr("Save all lines as a table (CSV)"),
        )  # fmt: skip
        save.clicked.connect(self.save_wanted)
        self._figures = named(MarkupLabel(), "inspect.section.figures", tr("Measurements"))
        self._figures.setWordWrap(True)
        self._figures.setAlignment(Qt.AlignmentFlag.AlignTop)
        scroll = QScrollArea()
        scroll.setWidgetResizable(True)
        scroll.setFrameShape(QFrame.Shape.NoFrame)
        scroll.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        scroll.setWidget(self._figures)
        scroll.setFixedWidth(SIDE_WIDTH)
        last = QHBoxLayout()
        last.addWidget(self._region, 1)
        last.addWidget(save)
        side = QVBoxLayout()
        for widget in (self.choice, self._width, self._level, self._cutoff):
            widget.setFixedWidth(SIDE_WIDTH)
            side.addWidget(widget)
        side.addLayout(last)
        side.addWidget(scroll, 1)
        row = QHBoxLayout(self)
        row.setContentsMargins(2, 2, 2, 4)
        row.setSpacing(2)
        row.addWidget(self._plot, 1)
        row.addLayout(side)

    def _make_plot(self) -> None:
        self._plot = ProfilePlot("inspect.section.plot")
        self._plot.setToolTip(
            tr(
                "Drag the two bands to compare two ranges. Drag the dashed line to set the "
                "depth of the width"
            )
        )
        self._plot.allow_level()
        self._ranges = []
        for brush, share in ((FIRST, Section().first), (SECOND, Section().second)):
            region = pg.LinearRegionItem(
                [share[0] * self._length, share[1] * self._length], brush=brush
            )
            region.sigRegionChanged.connect(self.changed)
            self._plot.addItem(region)
            self._ranges.append(region)

    def _make_level(self) -> None:
        self._level = named(
            DoubleSpinBox(), "inspect.section.level", tr("Depth at which the width is measured"),
            tr("Depth at which the width is measured. 0: half of the height"),
        )  # fmt: skip
        self._level.setRange(0.0, 5.0)
        self._level.setDecimals(3)
        self._level.setSingleStep(0.01)
        self._level.setSpecialValueText(tr("width at half height"))
        self._level.setPrefix(tr("width at "))
        self._level.setSuffix(tr(" mm"))
        self._level.valueChanged.connect(self.changed)
        self._plot.level_dragged.connect(self._level.setValue)

    def _make_cutoff(self) -> None:
        self._cutoff = named(
            ComboBox(), "inspect.section.cutoff", tr("Roughness of the line"),
            tr("Measure Ra, Rq and Rz along the line (ISO 21920). The cut-off separates roughness "
               "from waviness"),
        )  # fmt: skip
        self._cutoff.addItem(tr("no line roughness"), None)
        for cutoff_mm in CUTOFFS_MM:
            self._cutoff.addItem(tr("Ra, Rq, Rz at {c:g} mm").format(c=cutoff_mm), cutoff_mm)
        self._cutoff.currentIndexChanged.connect(lambda _: self.changed.emit())

    @property
    def cutoff_mm(self) -> float | None:
        """Cut-off of the roughness of the line. None: it is not measured."""
        chosen = self._cutoff.currentData()
        return None if chosen is None else float(chosen)

    @property
    def width_mm(self) -> float:
        """Width across the line over which depth is averaged."""
        return float(self._width.value())

    @property
    def level_mm(self) -> float | None:
        """Depth at which the width is measured. None: half of the height."""
        value = float(self._level.value())
        return value if value > 0.0 else None

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
        """Show the measurements of a frame."""
        self.cut = cut
        if cut.profile is not None:
            self._follow_length(float(cut.profile.along_mm[-1]))
        self._plot.show_profiles(cut.profiles, cut.chosen)
        self._plot.show_width(cut.width_ends)
        self._figures.setText(
            "<br>".join([*figure_lines(cut.figures), *map(escaped, cut.sentences)])
        )

    def _follow_length(self, length: float) -> None:
        """Keep the ranges at the same shares of a line whose length changed."""
        if abs(length - self._length) < 1e-6:
            return
        shares = self.ranges
        self._length = length
        for item, (low, high) in zip(self._ranges, shares, strict=True):
            item.blockSignals(True)
            item.setRegion([low * length, high * length])
            item.setBounds([0.0, length])
            item.blockSignals(False)


def figure_lines(figures: Sequence[Measured]) -> list[str]:
    """Return measured values as lines of markup. The slopes of the two ranges are labelled."""
    lines, seen = [], 0
    for figure in figures:
        where = ""
        if figure.name == "slope":
            where = (tr(" (blue)"), tr(" (green)"))[seen % 2]
            seen += 1
        lines.append(figure_text(figure, where))
    return lines


def figure_text(figure: Measured, where: str = "") -> str:
    """Return a measured value with its unit and standard deviation, as markup."""
    figure = figure_in_unit(figure)
    unit = "°" if figure.unit == DEG else f" {figure.unit}"
    digits = {"mm": 3, "um": 1}.get(figure.unit, 1)
    sd = "" if figure.sd is None else f" ± {figure.sd:.{digits}f}"
    value = round(figure.value, digits) + 0.0  # never -0.0
    return f"{escaped(figure.label + where)}: <b>{value:.{digits}f}{sd}{unit}</b>"
