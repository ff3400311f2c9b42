"""The cross-section: depth along the line, with measurements."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import zip_longest

import numpy as np
import pyqtgraph as pg
from PySide6.QtCore import Qt
from PySide6.QtGui import QColor
from PySide6.QtWidgets import QWidget

from app.live.tool_layer import DrawnTool, corners_of, rectangle_grips, rectangle_moved
from app.views.map.handles import Handle
from app.views.map.profile_plot import LINE_INK, ProfilePlot
from app.views.map.sections import SectionResult, SectionSettings
from app.widgets.actions import Slot, push_button
from app.widgets.forms import Form
from app.widgets.label import MarkupLabel, escaped
from app.widgets.layout import hbox, scroll_area, vbox
from app.widgets.widget_names import set_names
from gelpolight_core.base.arrays import PointXY
from gelpolight_core.measurement.area import Rectangle
from gelpolight_core.reconstruction.height_map import Flag, HeightMap

REGION_INK, POINT_INK = "#ff5c2e", "#5ad7ff"
LEAST_MM = 0.05
REACH = 0.75
"""Distance of the first points from the middle of the map, of half its shorter side."""


class SectionMarks:
    """The section line on the map, a rectangle, and three points of a plane.

    A user of :class:`app.live.tool_layer.ToolLayer`.

    Parameters
    ----------
    on_moved : callable
        Called when something was dragged.

    Attributes
    ----------
    start_mm, end_mm : (x, y)
        Ends of the line.
    rectangle : Rectangle
        The measured rectangle.
    points_mm : tuple of (x, y)
        Three points.
    """

    def __init__(self, on_moved: Callable[[], object]) -> None:
        self._on_moved = on_moved
        self.start_mm, self.end_mm = SectionSettings().start_mm, SectionSettings().end_mm
        self.rectangle = Rectangle((0.0, 0.0), (4.0, 4.0))
        self.points_mm: tuple[PointXY, ...] = ()
        self._placed = False

    @property
    def _middle(self) -> PointXY:
        (x0, y0), (x1, y1) = self.start_mm, self.end_mm
        return 0.5 * (x0 + x1), 0.5 * (y0 + y1)

    def spread(self, heightmap: HeightMap) -> None:
        """Place the line across the working area and the points in it, until one is dragged."""
        x_mm, y_mm = heightmap.x_mm, heightmap.y_mm
        inside = heightmap.flags[len(y_mm) // 2] & Flag.OUTSIDE.value == 0
        if self._placed or not inside.any():
            return
        left, right = (float(end) for end in x_mm[inside][[0, -1]])
        middle = 0.5 * (left + right), float(y_mm[len(y_mm) // 2])
        self.start_mm, self.end_mm = (left, middle[1]), (right, middle[1])
        reach_mm = 0.5 * REACH * min(right - left, float(y_mm[-1] - y_mm[0]))
        angles_rad = np.radians([[210.0, 330.0, 90.0], [120.0, 240.0, 0.0]])
        points = reach_mm * np.cos(angles_rad).T + middle
        self.points_mm = tuple((x, y) for x, y in points.tolist())

    def drawn(
        self, *, line: bool, rectangle: bool, points: bool, width_mm: float
    ) -> tuple[tuple[DrawnTool, ...], tuple[Handle, ...]]:
        """Return the lines on the map with their handles. The band shows the width of the mean."""
        tools, grips = list[DrawnTool](), list[Handle]()
        if line:
            ends = self.start_mm, self.end_mm
            band = (*self._shifted(0.5 * width_mm), *reversed(self._shifted(-0.5 * width_mm)))
            tools.append(DrawnTool(0, (ends,), LINE_INK, width=3.0, band=band))
            grips += [Handle("start", self.start_mm), Handle("middle", self._middle)]
            grips.append(Handle("end", self.end_mm))
        if rectangle:
            tools.append(DrawnTool(0, (corners_of(self.rectangle),), REGION_INK))
            grips += rectangle_grips(self.rectangle)
        if points:
            for number, point in enumerate(self.points_mm, start=1):
                tools.append(DrawnTool(0, ((point,),), POINT_INK, str(number)))
                grips.append(Handle(str(number), point))
        return tuple(tools), tuple(grips)

    def _shifted(self, by_mm: float) -> tuple[PointXY, PointXY]:
        """Return the ends of the line, moved across it."""
        (x0, y0), (x1, y1) = self.start_mm, self.end_mm
        length = math.dist(self.start_mm, self.end_mm)
        dx, dy = -by_mm * (y1 - y0) / length, by_mm * (x1 - x0) / length
        return (x0 + dx, y0 + dy), (x1 + dx, y1 + dy)

    # Called by the layer

    def on_point(self, at_mm: PointXY) -> None:
        """Do nothing: no tool is placed by clicks."""

    def on_tool(self, key: int) -> None:
        """Do nothing: there is nothing to choose."""

    def on_grip(self, name: str) -> None:
        """Do nothing: no handle is moved by keys."""

    def on_drag(self, name: str, to_mm: PointXY, *, ended: bool) -> None:
        """Move an end or the middle of the line, the rectangle or a point."""
        self._placed = True
        if name.isdigit():
            index = int(name) - 1
            self.points_mm = (*self.points_mm[:index], to_mm, *self.points_mm[index + 1 :])
        elif name == "start":
            self.start_mm = _apart(to_mm, self.end_mm)
        elif name == "end":
            self.end_mm = _apart(to_mm, self.start_mm)
        elif name == "middle":
            dx, dy = np.subtract(to_mm, self._middle).tolist()
            (x0, y0), (x1, y1) = self.start_mm, self.end_mm
            self.start_mm, self.end_mm = (x0 + dx, y0 + dy), (x1 + dx, y1 + dy)
        else:
            self.rectangle = rectangle_moved(self.rectangle, name, to_mm)
        self._on_moved()


def _apart(end_mm: PointXY, other_mm: PointXY) -> PointXY:
    """Return an end of a line that is not too near the other one."""
    near = math.dist(end_mm, other_mm) < LEAST_MM
    return (other_mm[0] + LEAST_MM, other_mm[1]) if near else end_mm


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
        set_names(self, "inspect.section", "Cross-section")
        self.cut = SectionResult()
        self._make_plot()
        self.form = Form(SectionSettings(), "inspect.section")
        self.form.changed.connect(lambda _name: on_changed())
        self._plot.level_dragged.connect(lambda depth_mm: self.form.change(level_mm=depth_mm))
        texts = {"accessible": "Save the profile", "tip": "Save the profile as a table (CSV)"}
        save = push_button("inspect.section.save", "Save…", on_save, **texts)
        self._figures = set_names(MarkupLabel(wrap=True), "inspect.section.figures", "Measurements")
        self._figures.setAlignment(Qt.AlignmentFlag.AlignTop)
        figures, settings = scroll_area(self._figures), QWidget()
        vbox(self.form, save, None, of=settings, margins=0, spacing=4)
        figures.setMinimumWidth(150)
        settings.setFixedWidth(210)
        hbox((self._plot, 3), (figures, 1), settings, of=self, margins=(8, 4, 8, 4), spacing=8)

    def _make_plot(self) -> None:
        self._plot = ProfilePlot("inspect.section.plot")
        self._plot.setToolTip(
            "The step goes from the tinted part at the start to that in the middle of the object. "
            "Drag the dashed line to set the depth of the width"
        )
        self._plot.allow_level()
        self._parts = [
            pg.LinearRegionItem(brush=PART, pen=pg.mkPen(None), movable=False) for _ in range(2)
        ]
        for part in self._parts:
            self._plot.addItem(part, ignoreBounds=True)

    def show_cut(self, cut: SectionResult) -> None:
        """Show the measurements of a frame."""
        self.cut = cut
        self._plot.show_profile(cut.profile)
        for part, ends in zip_longest(self._parts, cut.step_parts):
            part.setVisible(ends is not None)
            if ends is not None:
                part.setRegion(ends)
        self._plot.show_width(cut.width_ends)
        lines = [f"{escaped(f.label)}: <b>{escaped(f.text)}</b>" for f in cut.figures]
        self._figures.setText("<br>".join([*lines, *map(escaped, cut.sentences)]))
