"""The height map with measuring tools: placed by clicks, dragged, or moved by keys."""

from __future__ import annotations

import math

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QKeyEvent
from PySide6.QtWidgets import QWidget

from app.live.frame_results import Shown
from app.live.height_panel import HeightPanel
from app.measure.figures_text import figure_text
from app.measure.grips import Point, grips_of, outline_of
from app.measure.palette import Palette
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
    """The map, the palette next to it and a line of text below.

    Parameters
    ----------
    work : Work
        Holds the tools and results.

    Signals
    -------
    freeze_wanted()
        A tool was chosen: the image must be frozen.
    refused(str)
        A sentence: why a tool cannot be placed like this.
    drawn(object, int)
        The tools as they are drawn now (tuple of DrawnTool), and the key of the chosen one.
    """

    freeze_wanted = Signal()
    refused = Signal(str)
    drawn = Signal(object, int)

    def __init__(self, work: Work) -> None:
        super().__init__()
        named(self, "measure.map", tr("Height map with tools"))
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self._work = work
        self._kind = ""
        self._points: list[Point] = []
        self._live: HeightMap | None = None
        self.panel = HeightPanel()
        self.view = self.panel.map
        self.layer = ToolLayer()
        self.view.box.addItem(self.layer, ignoreBounds=True)
        self.tools = Palette(self)
        self.hint = named(PlainLabel(), "measure.hint", tr("What to do next on the map"))
        self.readout = named(PlainLabel(), "measure.readout", tr("Values under the pointer"))
        foot = hbox((self.hint, 1), self.readout, margins=(8, 2, 8, 2))
        right = vbox((self.panel, 1), foot, spacing=0)
        hbox(self.tools, (right, 1), of=self, margins=0, spacing=0)
        self.tools.chosen.connect(self._place)
        self.layer.clicked.connect(self._on_point)
        self.layer.chosen.connect(self._work.choose)
        self.layer.grip_chosen.connect(self._on_grip)
        self.layer.dragged.connect(lambda name, x, y: self._work.drag(name, (x, y)))
        self.layer.dropped.connect(lambda name, x, y: self._work.drop(name, (x, y)))
        self.view.pointed.connect(self._on_pointed)
        self._work.changed.connect(self._draw)
        self._work.image_changed.connect(self._show_results)

    # The image

    def show_live(self, shown: Shown, display: Display) -> None:
        """Show the depth of a live frame while no image is frozen."""
        if shown.heightmap is not None:
            self._live = shown.heightmap
            self.panel.show_frame(shown, display.colours, still=False)

    def say(self, text: str) -> None:
        """Show a text instead of the map."""
        self._live = None
        self.view.say(text)

    def _show_results(self) -> None:
        image_results = self._work.image_results
        if image_results is not None:
            rgb, shown = image_results.map_image.rgb, image_results.map_image.range_mm
            self.panel.show_image(rgb, image_results.heightmap, Display().colours, shown)
        elif self._work.image is None:
            self.cancel_placing()

    @property
    def heightmap(self) -> HeightMap | None:
        """The height map shown."""
        return self._live if self._work.image is None else self._work.heightmap

    # Placing

    def cancel_placing(self) -> None:
        """Stop placing a tool."""
        self._place("")
        self.tools.deselect()

    def _place(self, name: str) -> None:
        """Begin to place a tool. Empty: none."""
        self._kind, self._points = name, []
        self.layer.placing = bool(name)
        self.layer.show_begun(())
        self._report()
        if name:
            self.setFocus()
            self.freeze_wanted.emit()

    def _on_point(self, x_mm: float, y_mm: float) -> None:
        self.setFocus()
        self._points.append((x_mm, y_mm))
        self.layer.show_begun(tuple(self._points))
        if len(self._points) == len(self._asks()):
            self._add_tool(tuple(self._points))
        self._report()

    def _add_tool(self, points: tuple[Point, ...]) -> None:
        kind = self._kind
        self.cancel_placing()
        try:
            tool = make_tool(kind, points)
        except InputError as error:
            self.refused.emit(str(error))
            return
        self._work.add(tool)

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

    def _draw(self) -> None:
        work = self._work
        drawn = tuple(_drawn(k, tool, work.results.get(k)) for k, tool in work.sheet.items())
        grips = () if work.tool is None else grips_of(work.tool)
        self.layer.show_tools(drawn, work.chosen, grips, work.grip)
        self.drawn.emit(drawn, work.chosen)
        self._report()

    def _on_grip(self, name: str) -> None:
        self.setFocus()
        self._work.choose(self._work.chosen, name)

    def _on_pointed(self, x_mm: float, y_mm: float) -> None:
        heightmap = self.heightmap
        reading = None
        if heightmap is not None and math.isfinite(x_mm):
            reading = read_at(heightmap, x_mm, y_mm)
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
            if self._work.nudge(*(step * d for d in _ARROWS[key])):
                return
        match key:
            case Qt.Key.Key_PageDown | Qt.Key.Key_PageUp:
                self._next_grip(1 if key == Qt.Key.Key_PageDown else -1)
            case Qt.Key.Key_Return | Qt.Key.Key_Enter if self._kind:
                middle = self.view.box.viewRect().center()
                self._add_tool(first_points(self._kind, (middle.x(), middle.y())))
            case Qt.Key.Key_Delete | Qt.Key.Key_Backspace if self._work.chosen:
                self._work.remove(self._work.chosen)
            case Qt.Key.Key_Escape if self._kind:
                self.cancel_placing()
            case Qt.Key.Key_Escape if self._work.chosen:
                self._work.choose(0)
            case _:
                super().keyPressEvent(event)

    def _next_grip(self, step: int) -> None:
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
