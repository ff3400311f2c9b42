"""The cross-section: depth along the line, and its measurements."""

from __future__ import annotations

import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QWidget

from app.view2d.cuts import STEP_BETWEEN, Cut, Section
from app.view2d.profile_plot import ProfilePlot
from app.widgets.buttons import Slot, push_button
from app.widgets.forms import Form
from app.widgets.label import MarkupLabel, escaped
from app.widgets.layout import hbox, scroll_area, vbox
from app.widgets.naming import named

PART = QColor(11, 92, 173, 60)


class SectionPanel(QWidget):
    """Shows the profile, with the parts that give the step, and the level of the width.

    Parameters
    ----------
    on_changed : callable
        Called when the width, the level, or whether the rectangle is measured has changed.
    on_save : callable
        Called when the profile is to be saved.
    """

    def __init__(self, *, on_changed: Slot, on_save: Slot) -> None:
        super().__init__()
        named(self, "inspect.section", "Cross-section")
        self.cut = Cut()
        self._make_plot()
        self.form = Form(Section(), "inspect.section")
        self.form.changed.connect(lambda _name: on_changed())
        self._plot.level_dragged.connect(lambda depth_mm: self.form.change(level_mm=depth_mm))
        save = push_button(
            "inspect.section.save",
            "Save…",
            on_save,
            accessible="Save the profile",
            tip="Save the profile as a table (CSV)",
        )
        self._figures = named(MarkupLabel(wrap=True), "inspect.section.figures", "Measurements")
        self._figures.setAlignment(Qt.AlignmentFlag.AlignTop)
        figures, settings = scroll_area(self._figures), QWidget()
        vbox(self.form, save, None, of=settings, margins=0, spacing=4)
        scrolled = scroll_area(settings)
        figures.setFixedWidth(150)
        scrolled.setFixedWidth(210)
        hbox((self._plot, 1), figures, scrolled, of=self, margins=(8, 4, 8, 4), spacing=8)

    def _make_plot(self) -> None:
        self._plot = ProfilePlot("inspect.section.plot")
        self._plot.setToolTip(
            "The step goes from the tinted part at the start to that in the middle. Drag the "
            "dashed line to set the depth of the width"
        )
        self._plot.allow_level()
        self._parts = [
            pg.LinearRegionItem(brush=PART, pen=pg.mkPen(None), movable=False) for _ in STEP_BETWEEN
        ]
        for part in self._parts:
            self._plot.addItem(part, ignoreBounds=True)

    def show_cut(self, cut: Cut) -> None:
        """Show the measurements of a frame."""
        self.cut = cut
        self._plot.show_profile(cut.profile)
        for part, ends in zip(self._parts, STEP_BETWEEN, strict=True):
            part.setVisible(cut.profile is not None)
            if cut.profile is not None:
                part.setRegion([share * float(cut.profile.along_mm[-1]) for share in ends])
        self._plot.show_width(cut.width_ends)
        self._figures.setText(
            "<br>".join(
                [
                    *(f"{escaped(f.label)}: <b>{escaped(f.text)}</b>" for f in cut.figures),
                    *map(escaped, cut.sentences),
                ]
            )
        )
