"""Views of a frame: 3D, map with tools, camera, normals and quality, side by side.

The views share one cursor, and the same tools and lines are drawn on the map, in 3D and in the
camera image.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from types import MappingProxyType
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import QElapsedTimer, Qt
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QToolButton, QWidget

from app.program.context import AppContext
from app.program.display import LIMITS_MM
from app.program.jobs import JobQueue
from app.views.map.colour_bar import depth_counts
from app.views.map.handles import Handle
from app.views.map.map_point import PixelMap, PointReading, read_at
from app.views.map.map_view import MapView, extent_of
from app.views.surface.display_surface import SurfaceLine, densify_line
from app.views.surface.panel import SurfacePanel
from app.views.surface.scene_export import DIRECTIONS
from app.widgets.actions import Slot, icon_button, make_action
from app.widgets.layout import hbox, splitter, vbox
from app.widgets.widget_names import set_names
from gelpolight_core.base.arrays import PointXY
from gelpolight_core.base.compared_quantity import readable_unit
from gelpolight_core.base.form_fields import choice, switch
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.sensor.sensor_calibration import Calibration

from .frame_processor import FrameResult
from .image_view import ImageView
from .overlay import ImageOverlay, OverlayLine, OverlayMarker
from .overlay_item import colour_of
from .tool_layer import DrawnTool, ToolLayer, ToolLayerOwner

HISTOGRAM_MS = 200
"""Minimum time between two histograms of a live map, so that they can be read."""


class HeightPanel(QWidget):
    """Shows the height map, its colour bar, how often each depth occurs, and tools on the map.

    Parameters
    ----------
    user : ToolLayerOwner
        Called when the tools are clicked or dragged.
    adjustable : bool, optional
        Whether the ends of the colour range can be dragged.
    """

    def __init__(self, user: ToolLayerOwner, *, adjustable: bool = False) -> None:
        super().__init__()
        set_names(self, "inspect.height", "Height map")
        limits = LIMITS_MM if adjustable else None
        self.map = MapView("inspect.height.map", "Height map", limits=limits)
        self.layer = ToolLayer(user)
        self.map.box.addItem(self.layer, ignoreBounds=True)
        self._since_histogram = QElapsedTimer()
        self.column = vbox((self.map, 1), of=self, margins=0, spacing=0)
        self.map.show_message("No depth yet.")
        if adjustable:
            self.map.bar.setToolTip(
                "Drag a handle to set and lock the colour range. Double-click: automatic range."
            )

    def show_frame(self, result: FrameResult, *, still: bool) -> None:
        """Show a frame's height map. The histogram is updated a few times per second."""
        if result.height is None or result.heightmap is None:
            return
        self.map.set_image(result.height, extent_of(result.heightmap))
        unit, factor = readable_unit(*result.range_mm)
        self.map.show_colours(result.colours, *result.range_mm, unit, factor=factor)
        since = self._since_histogram
        if still or not since.isValid() or since.elapsed() >= HISTOGRAM_MS:
            since.start()
            self.map.bar.show_histogram(depth_counts(result.heightmap, result.range_mm))

    def show_message(self, text: str) -> None:
        """Show a text instead of the map."""
        self.map.show_message(text)


STAGES = {
    "surface": ("3D", ("surface",)),
    "height": ("Map", ("height",)),
    "camera": ("Camera", ("camera",)),
    "normals": ("Normals", ("normals",)),
    "quality": ("Quality", ("quality",)),
    "two": ("3D + map", ("surface", "height")),
    "four": ("All", ("surface", "height", "camera", "quality")),
}
"""What fills the viewer: the text of the button, and the views. Alt and the number chooses it."""
ROWS = ("surface", "height"), ("camera", "normals", "quality")
SECTION_PX = 230


@dataclass(frozen=True, slots=True)
class ViewLayout:
    """Visible parts of the viewer: one of STAGES, the section, the whole page or not."""

    stage: str = choice("surface", "", {key: text for key, (text, _) in STAGES.items()})
    section: bool = switch(True, "", "")
    maximised: bool = False

    @property
    def views(self) -> frozenset[str]:
        """Keys of the visible views."""
        below = {"section"} if self.section and not self.maximised else set()
        return frozenset(STAGES[self.stage][1]) | below


class FramePanel(Protocol):
    """A view of a frame as a map."""

    map: MapView

    def show_frame(self, result: FrameResult, *, still: bool) -> None:
        """Show a frame, live or `still`."""

    def show_message(self, text: str) -> None:
        """Show a text instead of the map."""


class FrameViewer(QWidget):
    """Shows frames in the chosen views.

    Parameters
    ----------
    page : str
        First part of the object names.
    jobs : JobQueue
        Load the 3D view.
    map_panel : HeightPanel
        The height map, on which the tools are dragged.
    section : QWidget
        Below the views.
    on_arranged, on_pointed : callable
        Called when other views are visible, and when the pointer is at another position.
    context : AppContext
        Holds the settings and the messages.
    more : mapping of str to FramePanel, optional
        Further views.
    beside : QWidget, optional
        Hidden while the viewer is maximised.

    Attributes
    ----------
    arranged : ViewLayout
        Visible views.
    parts : QSplitter
        The views.
    bar : QHBoxLayout
        The row of buttons above the views; a page may add more at its end.
    """

    def __init__(
        self,
        page: str,
        jobs: JobQueue,
        map_panel: HeightPanel,
        section: QWidget,
        *,
        on_arranged: Slot,
        on_pointed: Slot,
        context: AppContext,
        more: Mapping[str, FramePanel] = MappingProxyType({}),
        beside: QWidget | None = None,
    ) -> None:
        super().__init__()
        set_names(self, f"{page}.stage", "Views")
        self._page, self._on_arranged, self._on_pointed = page, on_arranged, on_pointed
        self.arranged = ViewLayout()
        self._pixel_map: PixelMap | None = None
        self._heightmap: HeightMap | None = None
        self._cursor = math.nan, math.nan
        self._image_lines: tuple[OverlayLine, ...] = ()
        self.surface = SurfacePanel(
            jobs,
            settings=context.settings,
            display=context.display,
            report=context.toasts.show,
            flat=lambda: MapView(f"{page}.surface.flat", "Shaded map"),
        )
        for name, (text, keys) in DIRECTIONS.items():
            title, view = f"3D: {text}", partial(self.surface.view_from, name)
            make_action(self, f"{page}.view_{name}", title, view, keys=(keys,))
        self.map_panel, self.section, self._beside = map_panel, section, beside
        self.camera = ImageView()
        self.panels: dict[str, FramePanel] = {"height": map_panel, **more}
        views = {"surface": self.surface, "camera": self.camera}
        self._parts: dict[str, Any] = {**views, **self.panels}
        self._lay_out()
        self._pointed_views: tuple[Any, ...] = (
            *(panel.map for panel in self.panels.values()),
            self.surface,
        )
        for view in self._pointed_views:
            view.pointed.connect(self.point_at)
        self.camera.pointed.connect(self._on_image_pointed)

    def _lay_out(self) -> None:
        self._rows = [
            splitter(
                Qt.Orientation.Horizontal,
                *((self._parts[key], 1) for key in row if key in self._parts),
                sizes=(600, 400, 400),
            )
            for row in ROWS
        ]
        self.parts = splitter(
            Qt.Orientation.Vertical,
            *((row, 3) for row in self._rows),
            (self.section, 2),
            sizes=(3 * SECTION_PX, 2 * SECTION_PX, SECTION_PX),
        )
        self._switches: dict[str, QAction] = {}
        self.bar = hbox(margins=(12, 6, 12, 6), spacing=4)
        for number, (key, (text, views)) in enumerate(STAGES.items(), start=1):
            if set(views) <= self._parts.keys():
                self.bar.addWidget(self._button(key, text, f"Alt+{number}"))
        self.bar.addStretch(1)
        self.bar.addWidget(self._button("section", "Section", "Alt+0"))
        if self._beside is not None:
            self.bar.addWidget(self._button("maximised", "Maximise", "F", "maximise"))
        self.surface.setFocusPolicy(Qt.FocusPolicy.ClickFocus)
        vbox(self.bar, (self.parts, 1), of=self, margins=0, spacing=0)

    def _button(self, key: str, text: str, keys: str, icon_name: str = "") -> QToolButton:
        name, choose = f"{self._page}.show_{key}", partial(self._choose, key)
        action = make_action(
            self, name, text, choose, keys=(keys,), icon_name=icon_name, checkable=True
        )
        self._switches[key] = action
        return icon_button(action)

    # What is visible

    def _choose(self, key: str) -> None:
        now = self.arranged
        if key in STAGES:
            self.arrange(replace(now, stage=key))
        else:
            changed: Any = {key: not getattr(now, key)}
            self.arrange(replace(now, **changed))

    def arrange(self, layout: ViewLayout) -> None:
        """Show these views."""
        before, self.arranged = self.arranged.views, layout
        on = {layout.stage: True, "section": layout.section, "maximised": layout.maximised}
        for key, action in self._switches.items():
            action.setChecked(on.get(key, False))
        for row, keys in zip(self._rows, ROWS, strict=True):
            row.setVisible(bool(layout.views & set(keys)))
        for key, part in self._parts.items():
            part.setVisible(key in layout.views)
        self.section.setVisible("section" in layout.views)
        self.surface.tools.setVisible("surface" in layout.views)
        if self._beside is not None:
            self._beside.setVisible(not layout.maximised)
        for key in layout.views & self.panels.keys() - before:
            if self._heightmap is not None and not self.panels[key].map.has_image:
                self.panels[key].show_message("Please wait.")
        self._lay_lines()
        self._on_arranged()

    def shows(self, name: str) -> bool:
        """Return whether a view, or the section, is visible."""
        return name in self.arranged.views

    # What is shown

    def use(self, calibration: Calibration | None) -> None:
        """Use this calibration for positions in the camera image."""
        self._pixel_map = None if calibration is None else PixelMap(calibration.table)

    def show_frame(self, result: FrameResult, *, still: bool = False) -> None:
        """Show a frame in every visible view, live or `still`."""
        if result.camera is not None:
            rows, columns = result.frame.rgb.shape[:2]
            self.camera.show_rgb(result.camera, size=(columns, rows))
        if result.fault is not None:
            self.show_message(result.fault.line)
        if result.heightmap is None:
            return
        self._heightmap = result.heightmap
        if result.surface is not None:
            self.surface.show_surface(result.surface, still=still)
        for key, panel in self.panels.items():
            if self.shows(key):
                panel.show_frame(result, still=still)
        if still:
            self._lay_lines()

    def show_message(self, text: str) -> None:
        """Show a text instead of the depth."""
        self._heightmap = None
        self.surface.show_message(text)
        for panel in self.panels.values():
            panel.show_message(text)

    def show_tools(
        self, tools: tuple[DrawnTool, ...], grips: tuple[Handle, ...] = (), grip: str = ""
    ) -> None:
        """Draw tools on the map with their handles, in 3D, and in the camera image."""
        self.map_panel.layer.show_tools(tools, grips, grip)
        self.surface.show_lines(
            tuple(
                SurfaceLine(line, colour_of(tool.role).name())
                for tool in tools
                for line in tool.lines
                if len(line) > 1
            )
        )
        self._lay_lines()

    # The cursor

    @property
    def reading(self) -> PointReading | None:
        """The values under the pointer. None: there are none."""
        if self._heightmap is None or not math.isfinite(self._cursor[0]):
            return None
        return read_at(self._heightmap, *self._cursor)

    @property
    def _depth_mm(self) -> NDArray[np.float32] | None:
        return None if self._heightmap is None else self._heightmap.depth_mm

    def point_at(self, x_mm: float, y_mm: float) -> None:
        """Mark a position in every view. NaN: none."""
        self._cursor = x_mm, y_mm
        for view in self._pointed_views:
            view.show_cursor(x_mm, y_mm)
        self._mark_image()
        self._on_pointed()

    def _on_image_pointed(self, u: float, v: float) -> None:
        point = None if self._pixel_map is None else self._pixel_map.point_of(u, v, self._depth_mm)
        self.point_at(*(point or (math.nan, math.nan)))

    def _lay_lines(self) -> None:
        """Find the lines of the tools in the camera image, and draw them."""
        self._image_lines = ()
        if self.shows("camera"):
            lines = (
                OverlayLine(np.array(pixels), tool.role)
                for tool in self.map_panel.layer.tools
                for line in tool.lines
                if len(line) > 1 and len(pixels := self._pixels(densify_line(line))) > 1
            )
            self._image_lines = tuple(lines)
        self._mark_image()

    def _mark_image(self) -> None:
        cursor = (OverlayMarker(*pixel, "cross", "info") for pixel in self._pixels([self._cursor]))
        self.camera.show_overlay(ImageOverlay(markers=tuple(cursor), lines=self._image_lines))

    def _pixels(self, points_mm: Any) -> list[PointXY]:
        """Return the pixels that see points on the surface."""
        pixels: list[PointXY] = []
        for x_mm, y_mm in points_mm:
            if self._pixel_map is not None and math.isfinite(x_mm):
                pixel = self._pixel_map.pixel_of(float(x_mm), float(y_mm), self._depth_mm)
                pixels += () if pixel is None else (pixel,)
        return pixels

    def finish(self) -> None:
        """Release the resources of the 3D view."""
        self.surface.finish()
