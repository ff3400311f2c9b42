"""Views below the map: the section of a tool, and the tools in 3D and in the camera image."""

from __future__ import annotations

from functools import partial

import numpy as np
from PySide6.QtCore import Signal
from PySide6.QtWidgets import QStackedWidget, QTabWidget, QWidget

from app.live.frame_results import Shown
from app.live.image_view import ImageView
from app.live.overlay import Line, Overlay, Role
from app.measure.measuring import ImageResults
from app.measure.solid import solid_of
from app.measure.tool_layer import COLOURS, DrawnTool
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
from app.widgets.label import PlainLabel
from app.widgets.naming import named
from gelpolight_core.errors import InputError
from gelpolight_core.measurement.fitted import fit_residual
from gelpolight_core.measurement.profile import Profile, take_profile
from gelpolight_core.measurement.profile_tools import ProfileWidth
from gelpolight_core.measurement.result import Measurement
from gelpolight_core.measurement.tools import Tool, ToolResult
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.translation import tr

# Fine enough for any tool, and fast to build.
NODES = 400
HEIGHT = 220
ROLES: dict[str, Role] = {"ok": "good", "doubtful": "expected", "refused": "bad", "chosen": "info"}


class Details(QTabWidget):
    """Section, 3D view and camera image next to the map. Only the visible view is updated.

    Parameters
    ----------
    jobs : Jobs
        Load the 3D view.
    settings : Settings
        Store its display settings.

    Signals
    -------
    wanted_changed()
        Another view became visible, or none.
    """

    wanted_changed = Signal()

    def __init__(self, jobs: Jobs, *, settings: Settings) -> None:
        super().__init__()
        named(self, "measure.details", tr("Section, 3D and camera"))
        self.setDocumentMode(True)
        self.setMinimumHeight(HEIGHT)
        self._image_results: ImageResults | None = None
        self._calibration: Calibration | None = None
        self._pixel_map: PixelMap | None = None
        self._drawn: tuple[DrawnTool, ...] = ()
        self._chosen = 0
        self._colour_by = "depth"
        self._measurement: Measurement | None = None
        self.plot = ProfilePlot("measure.section.plot")
        self._words = PlainLabel(tr("Choose a tool that uses a section: profile width (W)."))
        self._words.setMargin(20)
        self.section = QStackedWidget()
        self.section.addWidget(self._words)
        self.section.addWidget(self.plot)
        self.surface = SurfacePanel(
            jobs, settings=settings, flat=lambda: MapView("measure.flat", tr("Shaded map"))
        )
        self.surface.menu.set_colours(_quantities(), "depth")
        self.surface.menu.colour_chosen.connect(self._on_colour)
        self.camera = ImageView()
        self.addTab(self.section, tr("Section"))
        self.addTab(self.surface, tr("3D"))
        self.addTab(self.camera, tr("Camera"))
        self.currentChanged.connect(lambda _index: self._on_tab())
        self.hide()

    @property
    def wants_surface(self) -> bool:
        """Whether the surface is visible."""
        return self.isVisible() and self.currentWidget() is self.surface

    @property
    def wants_camera(self) -> bool:
        """Whether the camera image is visible."""
        return self.isVisible() and self.currentWidget() is self.camera

    def open_at(self, part: QWidget, on: bool = True) -> None:
        """Show one of the views, or hide them all."""
        self.setVisible(on)
        if on:
            self.setCurrentWidget(part)
        self._on_tab()

    def use(self, calibration: Calibration | None) -> None:
        """Use this calibration to draw tools in the camera image. The previous depth is cleared."""
        self._calibration, self._pixel_map = calibration, None
        self._image_results = None
        self.surface.show_surface(None)

    # What is shown

    def show_live(self, shown: Shown) -> None:
        """Show a frame while no image is frozen."""
        self._image_results = None
        if self.wants_surface and shown.surface is not None:
            self.surface.show_surface(shown.surface)
        if self.wants_camera and shown.camera is not None:
            rows, columns = shown.frame.rgb.shape[:2]
            self.camera.show_rgb(shown.camera, size=(columns, rows))

    def show_results(self, image_results: ImageResults | None) -> None:
        """Show a frozen image."""
        if image_results is not None and (
            self._image_results is None
            or image_results.heightmap is not self._image_results.heightmap
        ):
            self._image_results = image_results
            self.show_frozen()
        self._image_results = image_results

    def show_tools(self, drawn: tuple[DrawnTool, ...], chosen: int) -> None:
        """Show the tools as on the map."""
        self._drawn, self._chosen = drawn, chosen
        if self.wants_surface:
            lines = [
                SurfaceLine(line, COLOURS[self._state(tool)])
                for tool in drawn
                for line in tool.lines
                if len(line) > 1
            ]
            self.surface.show_lines(tuple(lines))
        if self.wants_camera:
            self._mark_camera()

    def show_result(self, tool: Tool | None, found: ToolResult | str | None) -> None:
        """Show the section of the chosen tool, if it has one."""
        measurement = found.measurement if isinstance(found, ToolResult) else None
        if measurement is not self._measurement:
            self._measurement = measurement
            self.surface.show_solid(None if measurement is None else partial(solid_of, measurement))
            if self._colour_by == "residual":
                self.show_frozen()
        profile = found.profile if isinstance(found, ToolResult) else self._cut(tool)
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

    def _cut(self, tool: Tool | None) -> Profile | None:
        """Return the section of a tool that could not measure, to show the reason."""
        if self._image_results is None or not isinstance(tool, ProfileWidth):
            return None
        try:
            return take_profile(
                self._image_results.heightmap, tool.start_mm, tool.end_mm, width_mm=tool.width_mm
            )
        except InputError:
            return None  # the message is next to the map

    def finish(self) -> None:
        """Release the resources of the 3D view."""
        self.surface.finish()

    def _on_tab(self) -> None:
        self.wanted_changed.emit()
        self.show_frozen()
        self.show_tools(self._drawn, self._chosen)

    def show_frozen(self) -> None:
        """Show the frozen image in the visible view."""
        image_results = self._image_results
        if image_results is None:
            return
        if self.wants_surface:
            self.surface.show_surface(self._frozen_surface(image_results))
        if self.wants_camera:
            shown = np.clip(255.0 * image_results.linear + 0.5, 0.0, 255.0)
            self.camera.show_rgb(shown.astype(np.uint8))

    def _frozen_surface(self, image_results: ImageResults) -> Surface | None:
        """Return the surface of the frozen image, coloured by depth or fit residual."""
        image, heightmap = image_results.map_image, image_results.heightmap
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

    def _mark_camera(self) -> None:
        width, height = self.camera.image_size
        lines = [
            Line(pixels, ROLES[self._state(tool)])
            for tool in self._drawn
            for line in tool.lines
            if len(pixels := self._pixels(line)) > 1
        ]
        size = (max(width, 1), max(height, 1))
        self.camera.overlay.set_overlay(Overlay(lines=tuple(lines)), size)

    def _pixels(self, line: tuple[tuple[float, float], ...]) -> np.ndarray:
        """Return the pixels that see a line on the surface, (N, 2)."""
        if self._calibration is None:
            return np.empty((0, 2))
        if self._pixel_map is None:
            self._pixel_map = PixelMap(self._calibration.table)
        depth = None if self._image_results is None else self._image_results.heightmap.depth_mm
        found = [self._pixel_map.pixel_of(float(x), float(y), depth) for x, y in along(line)]
        return np.array([pixel for pixel in found if pixel is not None]).reshape(-1, 2)

    def _state(self, tool: DrawnTool) -> str:
        return "chosen" if tool.key == self._chosen else tool.state


def _quantities() -> dict[str, str]:
    return {"depth": tr("Depth"), "residual": tr("Residual of the fitted object")}
