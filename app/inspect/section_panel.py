"""The cross-section: depth along the line, and its measurements."""

from __future__ import annotations

from collections.abc import Sequence

import pyqtgraph as pg
from PySide6.QtCore import QSignalBlocker, Qt, Signal
from PySide6.QtGui import QColor, QIcon, QPixmap
from PySide6.QtWidgets import QWidget

from app.inspect.section_line import SectionLines
from app.view2d.cuts import Cut, Section
from app.view2d.profile_plot import ProfilePlot, line_colour
from app.widgets.buttons import push_button, tool_button
from app.widgets.forms import Form
from app.widgets.inputs import ComboBox
from app.widgets.label import MarkupLabel, escaped
from app.widgets.layout import hbox, scroll_area, vbox
from app.widgets.naming import named
from app.widgets.units import figure_in_unit
from gelpolight_core.measurement.measured import Measured
from gelpolight_core.translation import tr

FIRST, SECOND = QColor(11, 92, 173, 60), QColor(23, 138, 70, 60)
DEG = "deg"


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
        self.form = Form(Section(), "inspect.section")
        self.form.changed.connect(self.changed)
        self._plot.level_dragged.connect(lambda depth_mm: self.form.change(level_mm=depth_mm))
        save = push_button(
            "inspect.section.save",
            tr("Save…"),
            self.save_wanted.emit,
            accessible=tr("Save the profiles"),
            tip=tr("Save all lines as a table (CSV)"),
        )
        self._figures = named(MarkupLabel(wrap=True), "inspect.section.figures", tr("Measurements"))
        self._figures.setAlignment(Qt.AlignmentFlag.AlignTop)
        figures, settings = scroll_area(self._figures), QWidget()
        vbox(self.choice, self.form, save, None, of=settings, margins=0, spacing=4)
        scrolled = scroll_area(settings)
        figures.setFixedWidth(150)
        scrolled.setFixedWidth(210)
        hbox((self._plot, 1), figures, scrolled, of=self, margins=(8, 4, 8, 4), spacing=8)

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


class LineChoice(QWidget):
    """The list of the lines in their colours, with buttons to add and remove one.

    Signals
    -------
    chosen(int)
        The line of this number was chosen.
    add_wanted(), remove_wanted()
        The buttons.
    """

    chosen = Signal(int)
    add_wanted = Signal()
    remove_wanted = Signal()

    def __init__(self) -> None:
        super().__init__()
        self._box = named(
            ComboBox(), "inspect.section.line", tr("Line whose values are shown"),
            tr("The values below belong to this line. A click on a line also selects it"),
        )  # fmt: skip
        self._box.activated.connect(lambda at: self.chosen.emit(self._box.itemData(at)))
        add, remove = tr("Add a line"), tr("Remove this line")
        self._add = tool_button(
            "inspect.section.line.add",
            "",
            self.add_wanted.emit,
            icon_name="add",
            accessible=add,
            tip=add,
        )
        self._remove = tool_button(
            "inspect.section.line.remove",
            "",
            self.remove_wanted.emit,
            icon_name="remove",
            accessible=remove,
            tip=remove,
        )
        hbox((self._box, 1), self._add, self._remove, of=self, margins=0, spacing=2)

    def show_lines(self, lines: SectionLines) -> None:
        """Show the lines, and which of them is chosen."""
        with QSignalBlocker(self._box):
            self._box.clear()
            for line in lines:
                sample = QPixmap(12, 12)
                sample.fill(QColor(line_colour(line.number)))
                text = tr("Line {n}").format(n=line.number)
                self._box.addItem(QIcon(sample), text, line.number)
            self._box.setCurrentIndex(self._box.findData(lines.chosen))
        self._add.setEnabled(lines.may_add)
        self._remove.setEnabled(lines.may_remove)
