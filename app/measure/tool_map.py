"""The palette of tools, the height map on which they are placed and moved, and their section."""

from __future__ import annotations

import re
from collections.abc import Callable
from contextlib import suppress
from itertools import groupby

from PySide6.QtCore import QSize, Qt
from PySide6.QtGui import QActionGroup, QKeyEvent
from PySide6.QtWidgets import (
    QListWidget,
    QListWidgetItem,
    QSizePolicy,
    QStackedWidget,
    QToolButton,
    QWidget,
)

from app.live.frame_viewer import HeightPanel
from app.live.tool_layer import CHOSEN, MEASURED, DrawnTool, outline_of, tool_handles
from app.views.map.map_point import PointReading
from app.views.map.profile_plot import ProfilePlot
from app.widgets.actions import icon_button, make_action
from app.widgets.icons import icon, tool_icon
from app.widgets.keys import ARROWS
from app.widgets.label import CutLabel, PlainLabel
from app.widgets.layout import hbox, vbox
from app.widgets.widget_names import set_names
from gelpolight_core.base.arrays import PointXY
from gelpolight_core.base.compared_quantity import value_text
from gelpolight_core.base.errors import InputError
from gelpolight_core.base.finding import finding_from_error
from gelpolight_core.measurement.tools.tool_base import PaletteEntry, Tool
from gelpolight_core.measurement.tools.tool_placing import first_points, make_tool
from gelpolight_core.measurement.tools.tool_registry import PALETTE, TOOLS, palette_entry

from .measurement_engine import ToolOutcome
from .measurement_model import MeasurementModel


class ToolPalette(QWidget):
    """One button for each kind of tool. A second click deselects it.

    Parameters
    ----------
    owner : QWidget
        The keys work while it is visible.
    on_chosen : callable
        Called with the name of the kind; empty if none is chosen any more.
    """

    def __init__(self, owner: QWidget, on_chosen: Callable[[str], object]) -> None:
        super().__init__()
        set_names(self, "measure.palette", "Measuring tools")
        self._owner, self._on_chosen = owner, on_chosen
        self.group = QActionGroup(self)
        self.group.setExclusionPolicy(QActionGroup.ExclusionPolicy.ExclusiveOptional)
        self.buttons: dict[str, QToolButton] = {}
        column = vbox(of=self, margins=0, spacing=2)
        sections = groupby(PALETTE.items(), key=lambda item: item[1].section)
        for number, (_, entries) in enumerate(sections):
            column.addSpacing(6 if number else 0)
            for name, entry in entries:
                column.addWidget(self._make_button(name, entry))

    def _make_button(self, name: str, entry: PaletteEntry) -> QToolButton:
        action = make_action(
            self._owner,
            f"measure.tool.{name}",
            entry.label,
            lambda: self._on_chosen(name if action.isChecked() else ""),
            keys=(entry.key,),
            icon_name=tool_icon(name),
            tip=entry.tip,
            checkable=True,
            inside=True,
        )
        self.group.addAction(action)
        button = self.buttons[name] = icon_button(action)
        button.setAutoRaise(True)
        button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        button.setIconSize(QSize(20, 20))
        button.setSizePolicy(QSizePolicy.Policy.Expanding, QSizePolicy.Policy.Fixed)
        return button

    def clear(self) -> None:
        """Choose no kind."""
        if (action := self.group.checkedAction()) is not None:
            action.setChecked(False)
        self._on_chosen("")


class ToolList(QListWidget):
    """Lists the tools of `work`, each with its first figure. A click chooses one."""

    def __init__(self, work: MeasurementModel) -> None:
        super().__init__()
        set_names(self, "measure.tools", "Tools on the image")
        self._work = work
        self.setIconSize(QSize(16, 16))
        self.setWordWrap(True)  # a value is never cut
        self.setStyleSheet("QListWidget { background: transparent; border: none }")
        self.setHorizontalScrollBarPolicy(Qt.ScrollBarPolicy.ScrollBarAlwaysOff)
        self.itemClicked.connect(lambda item: work.choose(item.data(Qt.ItemDataRole.UserRole)))

    def refresh(self) -> None:
        """Show the present tools."""
        self.clear()
        for key, tool in self._work.sheet.items():
            answer = self._work.answer_of(key)
            value = "" if answer.refused else "…"
            if answer.result is not None:
                # With the digits of the panel, but without the deviation, which has no room.
                value = re.sub(" ± [^ °]*", "", answer.result.figures[0].text)
                value = value.replace(" ", "\N{NO-BREAK SPACE}")
            entry = palette_entry(tool.name)
            item = QListWidgetItem(icon(tool_icon(tool.name)), f"{entry.label} {value}")
            item.setData(Qt.ItemDataRole.UserRole, key)
            self.addItem(item)
            if key == self._work.chosen:
                self.setCurrentItem(item)


NUDGE_MM = 0.02
LARGE_NUDGE_MM = 0.2


class ToolMap(HeightPanel):
    """The height map on which tools are placed and moved, and a line of text below it.

    Parameters
    ----------
    work : MeasurementModel
        Holds the tools and results.
    on_placed : callable
        Called when no tool is placed any more: with why not, or an empty text.
    """

    def __init__(self, work: MeasurementModel, on_placed: Callable[[str], object]) -> None:
        super().__init__(self)
        set_names(self, "measure.map", "Height map with tools")
        self.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        self._work, self._on_placed = work, on_placed
        self._kind = ""
        self._points: list[PointXY] = []
        self.hint = set_names(CutLabel(), "measure.hint", "What to do next on the map")
        self.readout = set_names(CutLabel(), "measure.readout", "Values under the pointer")
        self.column.addLayout(hbox((self.hint, 1), self.readout, margins=(12, 4, 12, 4)))

    # Placing

    def place(self, name: str) -> None:
        """Begin to place a tool. Empty: none."""
        self._kind, self._points = name, []
        self.layer.placing = bool(name)
        self.layer.show_begun(())
        self._report()
        if name:
            self.setFocus()

    def on_point(self, at_mm: PointXY) -> None:
        """Use a click on the map for the tool that is being placed."""
        self.setFocus()
        self._points.append(at_mm)
        self.layer.show_begun(tuple(self._points))
        if len(self._points) == len(self._asks()):
            self._add_tool(tuple(self._points))
        self._report()

    def _add_tool(self, points: tuple[PointXY, ...]) -> None:
        try:
            self._work.add(make_tool(TOOLS[self._kind], points))
        except InputError as error:
            self._on_placed(finding_from_error(error).line)
        else:
            self._on_placed("")

    def _asks(self) -> tuple[str, ...]:
        return PALETTE[self._kind].prompts if self._kind else ()

    def _report(self) -> None:
        asks = self._asks()
        text = ""
        if self._kind and len(self._points) < len(asks):
            text = (
                f"{asks[len(self._points)]}. Return places the tool in the middle, Escape cancels."
            )
        elif self._work.chosen and not self._work.refused:
            text = "Drag the squares, or move them with the arrow keys."
        self.hint.setText(text)

    # Drawing

    def drawn(self) -> tuple[DrawnTool, ...]:
        """Return the tools as they are now."""
        work = self._work
        self._report()
        return tuple(
            _drawn(key, tool, work.answer_of(key), chosen=key == work.chosen)
            for key, tool in ({} if work.refused else work.sheet).items()
        )

    def on_tool(self, key: int) -> None:
        """Choose a tool that was clicked."""
        self._work.choose(key)

    def on_grip(self, name: str) -> None:
        """Choose a handle of the chosen tool."""
        self.setFocus()
        self._work.choose(self._work.chosen, name)

    def on_drag(self, name: str, to_mm: PointXY, *, ended: bool) -> None:
        """Move a handle of the chosen tool."""
        (self._work.drop if ended else self._work.drag)(name, to_mm)

    def show_reading(self, reading: PointReading | None) -> None:
        """Show the values under the pointer. None: there is nothing under it."""
        text = ""
        if reading is not None:
            depth = value_text(reading.depth_mm)
            text = f"x {reading.x_mm:.2f} mm  y {reading.y_mm:.2f} mm  depth {depth}"
        self.readout.setText(text)

    # Keys

    def keyPressEvent(self, event: QKeyEvent) -> None:
        """Move the chosen handle, choose the next one, place, remove or cancel."""
        key = Qt.Key(event.key())
        if key in ARROWS:
            large = bool(event.modifiers() & Qt.KeyboardModifier.ShiftModifier)
            step = LARGE_NUDGE_MM if large else NUDGE_MM
            dx, dy = ARROWS[key]
            if self._work.nudge(step * dx, step * dy):
                return
        match key:
            case Qt.Key.Key_PageDown | Qt.Key.Key_PageUp:
                self.choose_next_grip(1 if key == Qt.Key.Key_PageDown else -1)
            case Qt.Key.Key_Return | Qt.Key.Key_Enter if self._kind:
                middle = self.map.box.viewRect().center()
                self._add_tool(first_points(TOOLS[self._kind], (middle.x(), middle.y())))
            case Qt.Key.Key_Delete | Qt.Key.Key_Backspace if self._work.chosen:
                self._work.remove()
            case Qt.Key.Key_Escape if self._kind:
                self._on_placed("")
            case Qt.Key.Key_Escape if self._work.chosen:
                self._work.choose(0)
            case _:
                super().keyPressEvent(event)

    def choose_next_grip(self, step: int) -> None:
        """Let the keys move another handle of the chosen tool."""
        work = self._work
        names = [] if work.tool is None else [grip.name for grip in tool_handles(work.tool)]
        if names:
            at = names.index(work.grip) if work.grip in names else -step
            work.choose(work.chosen, names[(at + step) % len(names)])


class ToolSection(QStackedWidget):
    """Shows the depth along the chosen tool, if it uses a section."""

    def __init__(self) -> None:
        super().__init__()
        self._words = PlainLabel("Choose a tool that uses a section: profile width (W).")
        self._words.setMargin(20)
        self.plot = ProfilePlot("measure.section.plot")
        for part in (self._words, self.plot):
            self.addWidget(part)

    def show_work(self, work: MeasurementModel) -> None:
        """Show the section of the chosen tool."""
        result, tool = work.result, work.tool
        profile = None if result is None else result.profile
        if result is None and work.heightmap is not None and tool is not None:
            with suppress(InputError):  # the message is in the inspector
                profile = tool.section(work.heightmap)
        self.setCurrentWidget(self._words if profile is None else self.plot)
        self.plot.show_profile(profile)
        self.plot.show_width(None if result is None else result.width_ends)


def _drawn(key: int, tool: Tool, answer: ToolOutcome, *, chosen: bool) -> DrawnTool:
    """Return a tool as it is drawn: as measured, or as it was placed."""
    result, role, text = answer.result, "bad" if answer.refused else MEASURED, ""
    if result is not None and result.tool == tool:
        lines = tuple(tuple((float(x), float(y)) for x, y in part) for part in result.drawing_mm)
        role = MEASURED if result.verdict == "ok" else "expected"
        text = result.figures[0].text
    else:
        lines = outline_of(tool) or (tuple(grip.at for grip in tool_handles(tool)),)
    return DrawnTool(key, lines, CHOSEN if chosen else role, text, role)
