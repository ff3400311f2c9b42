"""Below the map: the section that a tool reads, and the tools in 3D and in the camera's picture."""

from __future__ import annotations

import numpy as np
from PySide6.QtCore import Signal
from PySide6.QtWidgets import QStackedWidget, QTabWidget, QWidget

from app.inspect.draped import DrapedLine, along
from app.inspect.place import PixelPlaces
from app.inspect.products import Shown
from app.inspect.profile_plot import ProfilePlot
from app.inspect.surface import surface_of
from app.inspect.surface_panel import SurfacePanel
from app.live.overlay import Line, Overlay, Role
from app.live.picture_view import PictureView
from app.measure.measuring import Answer
from app.measure.tool_layer import COLOURS, DrawnTool
from app.shell.jobs import Jobs
from app.widgets.label import PlainLabel
from app.widgets.naming import named
from gelpolight_core.calibration.calibration import Calibration
from gelpolight_core.errors import InputError
from gelpolight_core.measurement.profile import Profile, take_profile
from gelpolight_core.measurement.profile_tools import ProfileWidth
from gelpolight_core.measurement.tools import Tool, ToolResult
from gelpolight_core.translation import tr

# Fine enough for any tool, and quick to be built.
NODES = 400
HEIGHT = 220
ROLES: dict[str, Role] = {"ok": "good", "doubtful": "expected", "refused": "bad", "chosen": "info"}


class Details(QTabWidget):
    """Shows what the map from above does not; the part in sight only.

    Parameters
    ----------
    jobs : Jobs
        Load the 3D view.

    Signals
    -------
    wanted_changed()
        Another part is in sight, or none.
    """

    wanted_changed = Signal()

    def __init__(self, jobs: Jobs) -> None:
        super().__init__()
        named(self, "measure.details", tr("Section, 3D and camera"))
        self.setDocumentMode(True)
        self.setMinimumHeight(HEIGHT)
        self._answer: Answer | None = None
        self._calibration: Calibration | None = None
        self._places: PixelPlaces | None = None
        self._drawn: tuple[DrawnTool, ...] = ()
        self._chosen = 0
        self.plot = ProfilePlot("measure.section.plot")
        self._words = PlainLabel(tr("Choose a tool that reads a section: profile width (W)."))
        self._words.setMargin(20)
        self.section = QStackedWidget()
        self.section.addWidget(self._words)
        self.section.addWidget(self.plot)
        self.surface = SurfacePanel(jobs)
        self.camera = PictureView()
        self.addTab(self.section, tr("Section"))
        self.addTab(self.surface, tr("3D"))
        self.addTab(self.camera, tr("Camera"))
        self.currentChanged.connect(lambda _index: self._on_tab())
        self.hide()

    @property
    def wants_surface(self) -> bool:
        """Whether the surface is in sight."""
        return self.isVisible() and self.currentWidget() is self.surface

    @property
    def wants_camera(self) -> bool:
        """Whether the camera's picture is in sight."""
        return self.isVisible() and self.currentWidget() is self.camera

    def open_at(self, part: QWidget, on: bool = True) -> None:
        """Show one of the parts, or hide them all."""
        self.setVisible(on)
        if on:
            self.setCurrentWidget(part)
        self._on_tab()

    def use(self, calibration: Calibration | None) -> None:
        """Place tools in the camera's picture by this calibration; the depth before it goes."""
        self._calibration, self._places = calibration, None
        self._answer = None
        self.surface.show_surface(None)

    # What is shown

    def show_live(self, shown: Shown) -> None:
        """Show a frame while nothing is held."""
        self._answer = None
        if self.wants_surface and shown.surface is not None:
            self.surface.show_surface(shown.surface)
        if self.wants_camera and shown.camera is not None:
            rows, columns = shown.frame.rgb.shape[:2]
            self.camera.show_rgb(shown.camera, size=(columns, rows))

    def show_answer(self, answer: Answer | None) -> None:
        """Show a picture that is held."""
        if answer is not None and (
            self._answer is None or answer.heightmap is not self._answer.heightmap
        ):
            self._answer = answer
            self._show_held()
        self._answer = answer

    def show_tools(self, drawn: tuple[DrawnTool, ...], chosen: int) -> None:
        """Show the tools as they are on the map."""
        self._drawn, self._chosen = drawn, chosen
        if self.wants_surface:
            lines = [
                DrapedLine(line, COLOURS[self._state(tool)])
                for tool in drawn
                for line in tool.lines
                if len(line) > 1
            ]
            self.surface.show_lines(tuple(lines))
        if self.wants_camera:
            self._mark_camera()

    def show_result(self, tool: Tool | None, found: ToolResult | str | None) -> None:
        """Show the section that the chosen tool reads, if it reads one."""
        profile = found.profile if isinstance(found, ToolResult) else self._cut(tool)
        self.section.setCurrentWidget(self._words if profile is None else self.plot)
        self.plot.show_profile(profile)
        if profile is None:
            return
        self.plot.show_length(float(profile.along_mm[-1]))
        width = None
        if isinstance(found, ToolResult) and isinstance(found.tool, ProfileWidth):
            start = np.array(profile.start_mm)
            ends = np.linalg.norm(found.drawing_mm[1] - start, axis=1)
            width = float(ends[0]), float(ends[1]), found["level"].value
        self.plot.show_width(width)

    def _cut(self, tool: Tool | None) -> Profile | None:
        """Return the section of a tool that could not measure on it: it shows why."""
        if self._answer is None or not isinstance(tool, ProfileWidth):
            return None
        try:
            return take_profile(
                self._answer.heightmap, tool.start_mm, tool.end_mm, width_mm=tool.width_mm
            )
        except InputError:
            return None  # the tool says so beside the map

    def finish(self) -> None:
        """Give back what the 3D view holds."""
        self.surface.finish()

    def _on_tab(self) -> None:
        self.wanted_changed.emit()
        self._show_held()
        self.show_tools(self._drawn, self._chosen)

    def _show_held(self) -> None:
        """Show the held picture in the part that is in sight."""
        answer = self._answer
        if answer is None:
            return
        if self.wants_surface:
            self.surface.show_surface(
                surface_of(answer.heightmap, answer.picture.rgb, largest=NODES)
            )
        if self.wants_camera:
            shown = np.clip(255.0 * answer.linear + 0.5, 0.0, 255.0)
            self.camera.show_rgb(shown.astype(np.uint8))

    def _mark_camera(self) -> None:
        width, height = self.camera.picture_size
        lines = [
            Line(pixels, ROLES[self._state(tool)])
            for tool in self._drawn
            for line in tool.lines
            if len(pixels := self._pixels(line)) > 1
        ]
        size = (max(width, 1), max(height, 1))
        self.camera.overlay.set_overlay(Overlay(lines=tuple(lines)), size)

    def _pixels(self, line: tuple[tuple[float, float], ...]) -> np.ndarray:
        """Return where a line on the surface is seen, (N, 2)."""
        if self._calibration is None:
            return np.empty((0, 2))
        if self._places is None:
            self._places = PixelPlaces(self._calibration.table)
        depth = None if self._answer is None else self._answer.heightmap.depth_mm
        found = [self._places.pixel_of(float(x), float(y), depth) for x, y in along(line)]
        return np.array([pixel for pixel in found if pixel is not None]).reshape(-1, 2)

    def _state(self, tool: DrawnTool) -> str:
        return "chosen" if tool.key == self._chosen else tool.state
