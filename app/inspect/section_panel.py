"""The cross-section: depth along the line, and its measurements."""

from __future__ import annotations

from collections.abc import Sequence

import pyqtgraph as pg
from PySide6.QtCore import QSignalBlocker, Qt
from PySide6.QtGui import QColor, QIcon, QPixmap
from PySide6.QtWidgets import QWidget

from app.inspect.section_line import SectionMarks
from app.view2d.cuts import Cut, Section
from app.view2d.profile_plot import ProfilePlot, line_colour
from app.widgets.buttons import Slot, push_button, tool_button
from app.widgets.forms import Form
from app.widgets.inputs import ComboBox
from app.widgets.label import MarkupLabel, escaped
from app.widgets.layout import hbox, scroll_area, vbox
from app.widgets.naming import named
from app.widgets.units import figure_in_unit
from gelpolight_core.measurement.measured import Measured

FIRST, SECOND = QColor(11, 92, 173, 60), QColor(23, 138, 70, 60)
DEG = "deg"


class SectionPanel(QWidget):
    """Shows the profiles, with two ranges to compare, and the level of the width.

    Parameters
    ----------
    marks : SectionMarks
        The lines.
    on_changed : callable
        Called when a range, the width, the level, or whether the rectangle is measured has changed.
    on_save : callable
        Called when the profiles are to be saved.
    """

    def __init__(self, marks: SectionMarks, *, on_changed: Slot, on_save: Slot) -> None:
        super().__init__()
        named(self, "inspect.section", "Cross-section")
        self._length = 12.0
        self.cut = Cut()
        self._make_plot(on_changed)
        self.choice = LineChoice(marks)
        self.form = Form(Section(), "inspect.section")
        self.form.changed.connect(lambda _name: on_changed())
        self._plot.level_dragged.connect(lambda depth_mm: self.form.change(level_mm=depth_mm))
        save = push_button(
            "inspect.section.save",
            "Save…",
            on_save,
            accessible="Save the profiles",
            tip="Save all lines as a table (CSV)",
        )
        self._figures = named(MarkupLabel(wrap=True), "inspect.section.figures", "Measurements")
        self._figures.setAlignment(Qt.AlignmentFlag.AlignTop)
        figures, settings = scroll_area(self._figures), QWidget()
        vbox(self.choice, self.form, save, None, of=settings, margins=0, spacing=4)
        scrolled = scroll_area(settings)
        figures.setFixedWidth(150)
        scrolled.setFixedWidth(210)
        hbox((self._plot, 1), figures, scrolled, of=self, margins=(8, 4, 8, 4), spacing=8)

    def _make_plot(self, on_changed: Slot) -> None:
        self._plot = ProfilePlot("inspect.section.plot")
        self._plot.setToolTip(
            "Drag the two bands to compare two ranges. Drag the dashed line to set the "
            "depth of the width"
        )
        self._plot.allow_level()
        self._ranges = []
        for brush, share in ((FIRST, Section().first), (SECOND, Section().second)):
            region = pg.LinearRegionItem(
                [share[0] * self._length, share[1] * self._length], brush=brush
            )
            region.sigRegionChanged.connect(lambda _region: on_changed())
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
            where = (" (blue)", " (green)")[seen % 2]
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
    """The list of the lines in their colours, with buttons to add and remove one."""

    def __init__(self, marks: SectionMarks) -> None:
        super().__init__()
        self._marks = marks
        tip = "The values below belong to this line. A click on a line also selects it"
        words = "Line whose values are shown"
        self._box = named(ComboBox(), "inspect.section.line", words, tip)
        self._box.activated.connect(lambda at: marks.on_tool(self._box.itemData(at)))
        self._add, self._remove = (
            tool_button(
                f"inspect.section.line.{name}", "", slot, icon_name=name, accessible=text, tip=text
            )
            for name, text, slot in (
                ("add", "Add a line", marks.add),
                ("remove", "Remove this line", marks.remove),
            )
        )
        hbox((self._box, 1), self._add, self._remove, of=self, margins=0, spacing=2)

    def refresh(self) -> None:
        """Show the lines, and which of them is chosen."""
        marks = self._marks
        with QSignalBlocker(self._box):
            self._box.clear()
            for number in marks.lines:
                sample = QPixmap(12, 12)
                sample.fill(QColor(line_colour(number)))
                self._box.addItem(QIcon(sample), f"Line {number}", number)
            self._box.setCurrentIndex(self._box.findData(marks.chosen))
        self._add.setEnabled(marks.may_add)
        self._remove.setEnabled(marks.may_remove)
