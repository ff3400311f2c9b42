"""The image being measured, the tools on it with their history, and their figures."""

from __future__ import annotations

from collections.abc import Mapping

from PySide6.QtCore import QObject, Signal
from PySide6.QtGui import QUndoCommand, QUndoStack

from app.live.tool_layer import move_handle, tool_handles
from app.program.display import DisplaySettings
from app.sources.latest import Done, Latest
from app.widgets.timers import timer
from gelpolight_core.measurement.shape_detection import DetectedShape
from gelpolight_core.measurement.tools.tool_base import Tool, ToolResult
from gelpolight_core.measurement.tools.tool_placing import make_tool
from gelpolight_core.measurement.tools.tool_registry import TOOLS, palette_entry
from gelpolight_core.reconstruction.height_map import HeightMap
from gelpolight_core.reconstruction.reconstructor import Reconstructor

from .measurement_engine import (
    ImageResults,
    MeasuredImage,
    MeasurementEngine,
    MeasureRequest,
    ToolOutcome,
)

ToolsByKey = Mapping[int, Tool]
"""The tools on the image by their keys, in the order of their placement. It is never changed."""
POLL_MS = 30
STOP_S = 30.0
"""Maximum time of an image with its uncertainty on a slow machine."""


class MeasurementModel(QObject):
    """The measurements on one image.

    Attributes
    ----------
    undo : QUndoStack
        History of the tools on the image.
    image_results : ImageResults or None
        Results of the image. None until it is reconstructed.
    chosen : int
        Key of the chosen tool. 0 for none.
    grip : str
        Name of its handle that the keys move. Empty for none.
    busy : bool
        Whether a measurement is running.
    refused : str
        Why the image cannot be measured. Empty if it can.
    answer : str
        What the last detection did not find. Empty if it found the object.

    Signals
    -------
    changed()
        Image, tools, choice, figures or answers changed.
    """

    changed = Signal()

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self._display = DisplaySettings()
        self.undo = QUndoStack(self)
        self.image: MeasuredImage | None = None
        self.image_results: ImageResults | None = None
        self.chosen = 0
        self.grip = self.refused = self.answer = ""
        self._sheet: ToolsByKey = {}
        self._preview: ToolsByKey | None = None
        self._reconstructor: Reconstructor | None = None
        self._propose = False
        self._detected = 0
        self.busy = False
        self._worker: Latest[MeasureRequest | None, ImageResults | None] | None = None
        self._timer = timer(self, POLL_MS, self._poll)

    # State

    @property
    def sheet(self) -> ToolsByKey:
        """The tools, including a drag in progress."""
        return self._sheet if self._preview is None else self._preview

    @property
    def heightmap(self) -> HeightMap | None:
        """Depth of the image."""
        return None if self.image_results is None else self.image_results.heightmap

    def answer_of(self, key: int) -> ToolOutcome:
        """Return the answer of a tool. That of a tool that was just moved may be an earlier one."""
        answers = {} if self.image_results is None else self.image_results.answers
        return answers.get(key, ToolOutcome())

    @property
    def tool(self) -> Tool | None:
        """The chosen tool."""
        return self.sheet.get(self.chosen)

    @property
    def result(self) -> ToolResult | None:
        """Current result of the chosen tool."""
        result = self.answer_of(self.chosen).result
        return result if result is not None and result.tool == self.tool else None

    # The image

    @property
    def placed_by_hand(self) -> bool:
        """Whether the image has other tools than the detected one."""
        return bool(self._sheet.keys() - {self._detected})

    def use(self, reconstructor: Reconstructor | None) -> None:
        """Measure with this calibration from now on."""
        self._reconstructor = reconstructor
        self.image_results, self.refused = None, ""
        self._ask()

    def take(self, image: MeasuredImage | None, *, propose: bool = False) -> None:
        """Measure on another image, or on none. It starts without tools."""
        self.image, self.image_results, self._preview = image, None, None
        self.undo.clear()
        self._sheet = {}
        self.chosen, self.grip = 0, ""
        self._propose = propose and image is not None
        self._detected = 0
        self.refused = self.answer = ""
        self._ask()

    def show_as(self, display: DisplaySettings) -> None:
        """Show the depth of the image with these settings."""
        self._display = display
        if self.image is not None:
            self._ask()

    @property
    def detecting(self) -> bool:
        """Whether the pressed object is being detected."""
        return self._propose and self.busy

    def propose(self) -> None:
        """Detect the pressed object. While this runs, a further request changes nothing."""
        if not self.detecting:
            self._propose, self.answer = True, ""
            self._ask()

    # Tools

    def add(self, tool: Tool) -> int:
        """Add a tool to the image and choose it. Return its key."""
        key = max(self._sheet, default=0) + 1
        self._edit("add", tool, {**self._sheet, key: tool}, key)
        return key

    def change(self, key: int, tool: Tool, *, nudge: bool = False) -> None:
        """Replace a tool. Successive key moves of one handle are one undo step."""
        self._edit("move", tool, {**self._sheet, key: tool}, key, nudge=nudge)

    def state_edge(self, radius_mm: float | None, sd_mm: float | None) -> None:
        """State the edge of the chosen cylinder or cuboid. It follows the reference, not undo."""
        tool = self._sheet[self.chosen]
        if (edged := tool.with_edge(radius_mm, sd_mm)) != tool:
            self.set_sheet({**self._sheet, self.chosen: edged}, self.chosen)

    def remove(self) -> None:
        """Remove the chosen tool from the image."""
        rest = dict(self._sheet)
        if (tool := rest.pop(self.chosen, None)) is not None:
            self._edit("remove", tool, rest, 0)

    def _edit(
        self, verb: str, tool: Tool, after: ToolsByKey, key: int, *, nudge: bool = False
    ) -> None:
        self._preview = None
        text = f"{verb} {palette_entry(tool.name).label}"
        self.undo.push(_ToolsEdit(self, after, key, text, nudge=nudge))

    def drag(self, grip: str, to_mm: tuple[float, float]) -> None:
        """Show the chosen tool with a handle moved, during a drag."""
        tool = self._sheet.get(self.chosen)
        if tool is not None:
            self._preview = {**self._sheet, self.chosen: move_handle(tool, grip, to_mm)}
            self._ask()

    def drop(self, grip: str, to_mm: tuple[float, float]) -> None:
        """End the drag: leave the chosen tool's handle at its position."""
        tool = self._sheet.get(self.chosen)
        if tool is not None:
            self.change(self.chosen, move_handle(tool, grip, to_mm))

    def nudge(self, dx_mm: float, dy_mm: float) -> bool:
        """Move the handle selected for the keys. Return whether there is one."""
        tool = self._sheet.get(self.chosen)
        grips = {} if tool is None else {grip.name: grip.at for grip in tool_handles(tool)}
        if tool is None or self.grip not in grips:
            return False
        x, y = grips[self.grip]
        self.change(self.chosen, move_handle(tool, self.grip, (x + dx_mm, y + dy_mm)), nudge=True)
        return True

    def choose(self, key: int, grip: str = "") -> None:
        """Choose a tool and the handle that the keys move: its first if none is named."""
        self._choose(key, grip)
        self.changed.emit()

    def _choose(self, key: int, grip: str) -> None:
        tool = self.sheet.get(key)
        self.chosen = 0 if tool is None else key
        grips = () if tool is None else tool_handles(tool)
        self.grip = grip or (grips[0].name if grips else "")

    def set_sheet(self, sheet: ToolsByKey, key: int) -> None:
        """Show another state of the tools, from the undo history."""
        self._sheet, self._preview = sheet, None
        self._choose(key, self.grip if key == self.chosen else "")
        self._ask()

    # The thread

    def close(self) -> None:
        """End the thread."""
        self._timer.stop()
        if self._worker is not None:
            self._worker.stop(STOP_S)
            self._worker = None
        self._reconstructor = None

    def _ask(self) -> None:
        maker, request = self._reconstructor, None
        if maker is not None and self.image is not None:
            request = MeasureRequest(
                maker.calibration,
                maker.model,
                self.image,
                self.sheet,
                self._display,
                self._propose,
            )
        if self._worker is None and request is not None:
            self._worker = Latest(MeasurementEngine(), name="measure")
            self._worker.start()
        if self._worker is not None:
            self._worker.submit(request)  # an empty request releases the last image
            self._timer.start()
        self.busy = request is not None
        self.changed.emit()

    def _poll(self) -> None:
        assert self._worker is not None
        done = self._worker.take()
        if self._worker.idle:
            self._timer.stop()
            self.busy = False
        if done is not None and done.request is not None:
            self._on_done(done.request, done)
        if done is not None or not self.busy:
            self.changed.emit()

    def _on_done(
        self, request: MeasureRequest, done: Done[MeasureRequest | None, ImageResults | None]
    ) -> None:
        maker = self._reconstructor
        if maker is None or request.image is not self.image:
            return  # about an earlier image
        if request.calibration is not maker.calibration or request.model != maker.model:
            return  # about an earlier calibration
        if done.failure:
            self.refused = done.failure
        elif done.result is not None:
            self.image_results = done.result
            if request.propose and self._propose:
                self._propose = False
                self._on_proposal(done.result.proposal)

    def _on_proposal(self, proposal: DetectedShape | None) -> None:
        if proposal is None:
            self.answer = (
                "No ball, cylinder or cuboid was found. Press one, or use the other tools."
            )
            return
        if len(proposal.candidates) > 1:
            names = " and ".join(palette_entry(shape).label for shape in proposal.candidates)
            self.answer = f"The object is not unique: {names} fit equally well. Choose one of them."
        if self._sheet.get(self._detected) is None:
            self._detected = self.add(make_tool(TOOLS[proposal.candidates[0]], (proposal.at_mm,)))
        else:
            # The same image has the same object: its tool remains, even if it was moved.
            self._choose(self._detected, "")


class _ToolsEdit(QUndoCommand):
    """One change of the tools on the image."""

    def __init__(
        self, work: MeasurementModel, after: ToolsByKey, key: int, text: str, *, nudge: bool = False
    ) -> None:
        super().__init__(text)
        self._work = work
        self._before, self._key_before = work.sheet, work.chosen
        self._after, self._key = after, key
        self._nudged = f"{key}/{work.grip}" if nudge else ""

    def redo(self) -> None:
        """Apply the change."""
        self._work.set_sheet(self._after, self._key)

    def undo(self) -> None:
        """Undo the change."""
        self._work.set_sheet(self._before, self._key_before)

    def id(self) -> int:
        """Return the kind of command that may be merged with the previous one."""
        return 1 if self._nudged else -1

    def mergeWith(self, other: QUndoCommand) -> bool:
        """Merge successive key moves of one handle."""
        assert isinstance(other, _ToolsEdit)
        if other._nudged != self._nudged:
            return False
        self._after = other._after
        return True
