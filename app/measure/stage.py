"""The views of a press: map, 3D or camera image fills the stage; the section is a drawer below."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
from numpy.typing import NDArray
from PySide6.QtCore import Qt
from PySide6.QtWidgets import QStackedWidget, QToolButton, QWidget

from app.live.frame_results import Shown, Wanted
from app.live.image_view import ImageView
from app.live.overlay import Line, Overlay, Role
from app.measure.measuring import ImageResults
from app.measure.solid import solid_of
from app.measure.tool_layer import COLOURS, DrawnTool
from app.measure.tool_map import ToolMap
from app.measure.work import Work
from app.services.jobs import Jobs
from app.services.settings import Settings
from app.view2d import shading
from app.view2d.display import Display
from app.view2d.map_point import PixelMap
from app.view2d.map_view import MapView
from app.view2d.profile_plot import ProfilePlot
from app.view2d.quantities import depth_scale, difference_scale
from app.view3d.panel import SurfacePanel
from app.view3d.picking import along
from app.view3d.surface import Surface, SurfaceLine, surface_of
from app.widgets.actions import switch_button
from app.widgets.label import PlainLabel
from app.widgets.layout import hbox, splitter, vbox
from app.widgets.naming import named
from gelpolight_core.errors import InputError
from gelpolight_core.measurement.fitted import fit_residual
from gelpolight_core.measurement.profile import Profile, take_profile
from gelpolight_core.measurement.profile_tools import ProfileWidth
from gelpolight_core.measurement.result import Measurement
from gelpolight_core.measurement.tools import ToolResult
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.translation import tr

# Fine enough for any tool, and fast to build.
NODES = 400
SECTION_PX = 220
ROLES: dict[str, Role] = {"ok": "good", "doubtful": "expected", "refused": "bad", "chosen": "info"}
VIEWS = {
    "map": (tr("Map"), "Alt+2"),
    "surface": (tr("3D"), "Alt+1"),
    "camera": (tr("Image"), "Alt+3"),
}


class Stage(QWidget):
    """Shows one of the views, and only updates this one.

    Parameters
    ----------
    tool_map : ToolMap
        The map with the tools.
    jobs : Jobs
        Load the 3D view.
    on_shown : callable
        Called when another view becomes visible.
    settings : Settings
        Store the display settings of the 3D view.

    Attributes
    ----------
    shown : str
        Name of the visible view.
    bar : QHBoxLayout
        The row above the views; a page may add more at its end.
    """

    def __init__(
        self, tool_map: ToolMap, jobs: Jobs, on_shown: Callable[[], object], *, settings: Settings
    ) -> None:
        super().__init__()
        named(self, "measure.stage", tr("Views of the press"))
        self._on_shown = on_shown
        self._work: Work | None = None
        self._results: ImageResults | None = None
        self._calibration: Calibration | None = None
        self._pixel_map: PixelMap | None = None
        self._colour_by = "depth"
        self._measurement: Measurement | None = None
        self.shown = "map"
        self.map = tool_map
        self.surface = SurfacePanel(
            jobs, settings=settings, flat=lambda: MapView("measure.flat", tr("Shaded map"))
        )
        self.surface.menu.set_colours(_quantities(), "depth")
        self.surface.menu.colour_chosen.connect(self._on_colour)
        self.camera = ImageView()
        self._stack = QStackedWidget()
        self._parts: dict[str, QWidget] = {
            "map": tool_map,
            "surface": self.surface,
            "camera": self.camera,
        }
        self._buttons: dict[str, QToolButton] = {}
        self.bar = hbox(margins=(12, 6, 12, 6), spacing=4)
        for name, (text, keys) in VIEWS.items():
            self._stack.addWidget(self._parts[name])
            self.bar.addWidget(self._button(name, text, partial(self.show_view, name), keys))
        self.bar.addStretch(1)
        self.bar.addWidget(self.surface.tools)
        self.surface.tools.hide()
        self.bar.addWidget(self._button("section", tr("Section"), self._toggle_section, "Alt+0"))
        self.plot = ProfilePlot("measure.section.plot")
        self._words = PlainLabel(tr("Choose a tool that uses a section: profile width (W)."))
        self._words.setMargin(20)
        self.section = QStackedWidget()
        self.section.addWidget(self._words)
        self.section.addWidget(self.plot)
        self.section.hide()
        split = splitter(Qt.Orientation.Vertical, (self._stack, 1), (self.section, 0))
        split.setSizes([3 * SECTION_PX, SECTION_PX])
        vbox(self.bar, (split, 1), of=self, margins=0, spacing=0)
        self._buttons["map"].setChecked(True)

    def _button(self, name: str, text: str, slot: Callable[[], object], keys: str) -> QToolButton:
        self._buttons[name] = switch_button(self, f"measure.show_{name}", text, slot, keys)
        return self._buttons[name]

    # What is visible

    def show_view(self, name: str) -> None:
        """Let one of the views fill the stage."""
        self.shown = name
        for other in VIEWS:
            self._buttons[other].defaultAction().setChecked(other == name)
        self._stack.setCurrentWidget(self._parts[name])
        self.surface.tools.setVisible(name == "surface")
        self._on_shown()
        self.show_frozen()

    def _toggle_section(self) -> None:
        self.section.setVisible(not self.section.isVisibleTo(self))
        self._show_section()

    def wanted(self, *, frozen: bool) -> Wanted:
        """Return what to compute from live frames: the depth, and what is visible."""
        visible = "" if frozen else self.shown
        return Wanted(height=True, surface=visible == "surface", camera=visible == "camera")

    def use(self, calibration: Calibration | None) -> None:
        """Use this calibration to draw tools in the camera image. The previous depth is cleared."""
        self._calibration, self._pixel_map = calibration, None
        self._results = None
        self.surface.show_surface(None)

    def finish(self) -> None:
        """Release the resources of the 3D view."""
        self.surface.finish()

    # What is shown

    def show_live(self, shown: Shown) -> None:
        """Show a frame while no image is frozen."""
        self._results = None
        self.map.show_live(shown, Display())
        if shown.surface is not None:
            self.surface.show_surface(shown.surface)
        if shown.camera is not None:
            rows, columns = shown.frame.rgb.shape[:2]
            self.camera.show_rgb(shown.camera, size=(columns, rows))

    def say(self, text: str) -> None:
        """Show a text instead of the map."""
        self.map.say(text)

    def show_work(self, work: Work) -> None:
        """Show the frozen image, its tools and their results."""
        self._work = work
        before, self._results = self._results, work.image_results
        measurement = None if work.result is None else work.result.measurement
        refitted, self._measurement = measurement is not self._measurement, measurement
        if refitted:
            self.surface.show_solid(None if measurement is None else partial(solid_of, measurement))
        self.map.draw()
        new = self._results is not None and (
            before is None or before.heightmap is not self._results.heightmap
        )
        if new or (refitted and self._colour_by == "residual"):
            self.show_frozen()
        else:
            self._show_tools()
        self._show_section()

    def show_frozen(self) -> None:
        """Show the frozen image in the visible view."""
        if (results := self._results) is not None:
            if self.shown == "map":
                self.map.show_results(results)
            elif self.shown == "surface":
                self.surface.show_surface(self._frozen_surface(results))
            else:
                shown = np.clip(255.0 * results.linear + 0.5, 0.0, 255.0)
                self.camera.show_rgb(shown.astype(np.uint8))
        self._show_tools()

    def _show_tools(self) -> None:
        """Show the tools of the map in the other views."""
        drawn = [(self._state(tool), line) for tool in self.map.drawn for line in tool.lines]
        if self.shown == "surface":
            lines = [SurfaceLine(line, COLOURS[state]) for state, line in drawn if len(line) > 1]
            self.surface.show_lines(tuple(lines))
        elif self.shown == "camera":
            width, height = self.camera.image_size
            marks = [
                Line(pixels, ROLES[state])
                for state, line in drawn
                if len(pixels := self._pixels(line)) > 1
            ]
            size = (max(width, 1), max(height, 1))
            self.camera.overlay.set_overlay(Overlay(lines=tuple(marks)), size)

    def _show_section(self) -> None:
        """Show the section of the chosen tool, if it has one."""
        if self._work is None or not self.section.isVisibleTo(self):
            return
        found = self._work.result
        profile = self._cut() if found is None else found.profile
        self.section.setCurrentWidget(self._words if profile is None else self.plot)
        self.plot.show_profiles({} if profile is None else {1: profile})
        if profile is None:
            return
        width = None
        if isinstance(found, ToolResult) and isinstance(found.tool, ProfileWidth):
            start = np.array(profile.start_mm)
            ends = np.linalg.norm(found.drawing_mm[1] - start, axis=1)
            width = float(ends[0]), float(ends[1]), found["level"].value
        self.plot.show_width(width)

    def _cut(self) -> Profile | None:
        """Return the section of a tool that could not measure, to show the reason."""
        tool = None if self._work is None else self._work.tool
        if self._results is None or not isinstance(tool, ProfileWidth):
            return None
        try:
            heightmap = self._results.heightmap
            return take_profile(heightmap, tool.start_mm, tool.end_mm, width_mm=tool.width_mm)
        except InputError:
            return None  # the message is in the inspector

    def _frozen_surface(self, results: ImageResults) -> Surface | None:
        """Return the surface of the frozen image, coloured by depth or fit residual."""
        image, heightmap = results.map_image, results.heightmap
        rgb, scale = image.rgb, depth_scale(Display().colours, image.range_mm)
        if self._colour_by == "residual" and self._measurement is not None:
            residual = fit_residual(heightmap, self._measurement)
            known = np.isfinite(residual)
            scale = difference_scale(residual[known], tr("residual [mm]"))
            coloured = shading.coloured(np.nan_to_num(residual), scale.table, scale.low, scale.high)
            rgb = np.where(known[..., None], coloured, np.uint8(128))
        return surface_of(heightmap, rgb, scale, range_mm=image.range_mm, largest=NODES)

    def _on_colour(self, quantity: str) -> None:
        self._colour_by = quantity
        self.surface.menu.set_colours(_quantities(), quantity)
        self.show_frozen()

    def _pixels(self, line: tuple[tuple[float, float], ...]) -> NDArray[np.float64]:
        """Return the pixels that see a line on the surface, (N, 2)."""
        if self._calibration is None:
            return np.empty((0, 2))
        if self._pixel_map is None:
            self._pixel_map = PixelMap(self._calibration.table)
        depth = None if self._results is None else self._results.heightmap.depth_mm
        found = [self._pixel_map.pixel_of(float(x), float(y), depth) for x, y in along(line)]
        return np.array([pixel for pixel in found if pixel is not None]).reshape(-1, 2)

    def _state(self, tool: DrawnTool) -> str:
        chosen = self._work is not None and tool.key == self._work.chosen
        return "chosen" if chosen else tool.state


def _quantities() -> dict[str, str]:
    return {"depth": tr("Depth"), "residual": tr("Residual of the fitted object")}
