"""The height map with measuring tools: placed by clicks, dragged, or moved by keys."""

from __future__ import annotations

import math
from collections.abc import Callable

from PySide6.QtCore import Qt
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QWidget

from app.live.frame_results import Shown
from app.live.height_panel import HeightPanel
from app.measure.figures_text import figure_text
from app.measure.grips import Point, grips_of, outline_of
from app.measure.measuring import ImageResults
from app.measure.placing import first_points, kinds, make_tool
from app.measure.tool_layer import DrawnTool, ToolLayer
from app.measure.work import Work
from app.view2d.display import Display
from app.view2d.map_point import read_at
from app.widgets.label import PlainLabel
from app.widgets.layout import hbox, vbox
from app.widgets.naming import named
from app.widgets.units import in_unit
from gelpolight_core.errors import InputError
from gelpolight_core.measurement.tools import Tool, ToolResult
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.translation import tr

NUDGE_MM = 0.02
LARGE_NUDGE_MM = 0.2
_ARROWS = {
    Qt.Key.Key_Left: (-1.0, 0.0),
    Qt.Key.Key_Right: (1.0, 0.0),
    Qt.Key.Key_Up: (0.0, -1.0),
    Qt.Key.Key_Down: (0.0, 1.0),
}


class ToolMap(QWidget):
    """The map, and a line of text below it.

    Parameters
    ----------
    work : Work
        Holds the tools and results.
    on_placed : callable
        Called when no tool is placed any more: with why not, or an empty text.

    Attributes
    ----------
    drawn : tuple of DrawnTool
        The tools as they are drawn.
    """

    def __init__(self, work: Work, on_placed: Callable[[str], object]) -> None:
        super().__init__()
        named(self, "measure.map", tr("Height map with tools"))
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self._work, self._on_placed = work, on_placed
        self._kind = ""
        self._points: list[Point] = []
        self._heightmap: HeightMap | None = None
        self.drawn: tuple[DrawnTool, ...] = ()
        self.panel = HeightPanel()
        self.view = self.panel.map
        self.layer = ToolLayer(self)
        self.view.box.addItem(self.layer, ignoreBounds=True)
        self.hint = named(PlainLabel(), "measure.hint", tr("What to do next on the map"))
        self.readout = named(PlainLabel(), "measure.readout", tr("Values under the pointer"))
        foot = hbox((self.hint, 1), self.readout, margins=(12, 4, 12, 4))
        vbox((self.panel, 1), foot, of=self, margins=0, spacing=0)
        self.view.pointed.connect(self._on_pointed)

    # The image

    def show_live(self, shown: Shown, display: Display) -> None:
        """Show the depth of a live frame while no image is frozen."""
        if shown.heightmap is not None:
            self._heightmap = shown.heightmap
            self.panel.show_frame(shown, display.colours, still=False)

    def say(self, text: str) -> None:
        """Show a text instead of the map."""
        self._heightmap = None
        self.view.say(text)

    def show_results(self, shown: ImageResults) -> None:
        """Show the depth of the frozen image."""
        self._heightmap = shown.heightmap
        image = shown.map_image
        self.panel.show_image(image.rgb, shown.heightmap, Display().colours, image.range_mm)

    # Placing

    def place(self, name: str) -> None:
        """Begin to place a tool. Empty: none."""
        self._kind, self._points = name, []
        self.layer.placing = bool(name)
        self.layer.show_begun(())
        self._report()
        if name:
            self.setFocus()

    def on_point(self, at_mm: Point) -> None:
        """Use a click on the map for the tool that is being placed."""
        self.setFocus()
        self._points.append(at_mm)
        self.layer.show_begun(tuple(self._points))
        if len(self._points) == len(self._asks()):
            self._add_tool(tuple(self._points))
        self._report()

    def _add_tool(self, points: tuple[Point, ...]) -> None:
        try:
            self._work.add(make_tool(self._kind, points))
        except InputError as error:
            self._on_placed(str(error))
        else:
            self._on_placed("")

    def _asks(self) -> tuple[str, ...]:
        return next((kind.asks for kind in kinds() if kind.name == self._kind), ())

    def _report(self) -> None:
        asks = self._asks()
        text = ""
        if self._kind and len(self._points) < len(asks):
            text = tr("{ask}. Return places the tool in the middle, Escape cancels.").format(
                ask=asks[len(self._points)]
            )
        elif self._work.chosen:
            text = tr("Drag the squares, or move them with the arrow keys.")
        elif self._work.image is not None:
            text = tr("Choose a tool on the left, or detect the object (Q).")
        self.hint.setText(text)

    # Drawing

    def draw(self) -> None:
        """Draw the tools as they are now."""
        work = self._work
        self.drawn = tuple(_drawn(k, tool, work.results.get(k)) for k, tool in work.sheet.items())
        grips = () if work.tool is None else grips_of(work.tool)
        self.layer.show_tools(self.drawn, work.chosen, grips, work.grip)
        self._report()

    def on_tool(self, key: int) -> None:
        """Choose a tool that was clicked."""
        self._work.choose(key)

    def on_grip(self, name: str) -> None:
        """Choose a grip of the chosen tool."""
        self.setFocus()
        self._work.choose(self._work.chosen, name)

    def on_drag(self, name: str, to_mm: Point, *, ended: bool) -> None:
        """Move a grip of the chosen tool."""
        (self._work.drop if ended else self._work.drag)(name, to_mm)

    def _on_pointed(self, x_mm: float, y_mm: float) -> None:
        reading = None
        if self._heightmap is not None and math.isfinite(x_mm):
            reading = read_at(self._heightmap, x_mm, y_mm)
        words = "" if reading is None else tr("x {x:.2f} mm  y {y:.2f} mm  depth {d}").format(
            x=reading.x_mm, y=reading.y_mm, d=in_unit(reading.depth_mm)
        )  # fmt: skip
        self.readout.setText(words)

    # Keys

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Move the chosen grip, choose the next one, place, remove or cancel."""
        key = Qt.Key(event.key())
        if key in _ARROWS:
            large = bool(event.modifiers() & Qt.KeyboardModifier.ShiftModifier)
            step = LARGE_NUDGE_MM if large else NUDGE_MM
            dx, dy = _ARROWS[key]
            if self._work.nudge(step * dx, step * dy):
                return
        match key:
            case Qt.Key.Key_PageDown | Qt.Key.Key_PageUp:
                self.choose_next_grip(1 if key == Qt.Key.Key_PageDown else -1)
            case Qt.Key.Key_Return | Qt.Key.Key_Enter if self._kind:
                middle = self.view.box.viewRect().center()
                self._add_tool(first_points(self._kind, (middle.x(), middle.y())))
            case Qt.Key.Key_Delete | Qt.Key.Key_Backspace if self._work.chosen:
                self._work.remove(self._work.chosen)
            case Qt.Key.Key_Escape if self._kind:
                self._on_placed("")
            case Qt.Key.Key_Escape if self._work.chosen:
                self._work.choose(0)
            case _:
                super().keyPressEvent(event)

    def choose_next_grip(self, step: int) -> None:
        """Let the keys move another grip of the chosen tool."""
        work = self._work
        names = [] if work.tool is None else [grip.name for grip in grips_of(work.tool)]
        if names:
            at = names.index(work.grip) if work.grip in names else -step
            work.choose(work.chosen, names[(at + step) % len(names)])


def _drawn(key: int, tool: Tool, found: ToolResult | str | None) -> DrawnTool:
    """Return a tool as it is drawn: as measured, or as it was placed."""
    if isinstance(found, ToolResult) and found.tool == tool:
        lines = tuple(tuple((float(x), float(y)) for x, y in part) for part in found.drawing_mm)
        state = "ok" if found.verdict == "ok" else "doubtful"
        return DrawnTool(key, lines, state, figure_text(found.figures[0]))
    lines = outline_of(tool) or (tuple(grip.at_mm for grip in grips_of(tool)),)
    return DrawnTool(key, lines, "refused" if isinstance(found, str) else "ok", "")
