"""The picture that is measured on, the tools on it with their history, and their figures."""

from __future__ import annotations

import logging
from collections.abc import Mapping
from types import MappingProxyType

from PySide6.QtCore import QObject, QTimer, Signal
from PySide6.QtGui import QUndoCommand, QUndoStack

from app.calibrate.lut_worker import NewestWins
from app.measure.grips import grips_of, moved
from app.measure.measuring import Answer, Measuring, Question, Taken
from app.measure.placing import kind_label
from app.measure.sheet import Sheet
from gelpolight_core.errors import InputError
from gelpolight_core.measurement.proposal import Proposal
from gelpolight_core.measurement.tools import Ball, Cuboid, Cylinder, Tool, ToolResult
from gelpolight_core.reconstruction.heightmap import HeightMap
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.translation import tr

_LOG = logging.getLogger(__name__)
POLL_MS = 30
STOP_S = 30.0
"""The longest that a picture with its uncertainty takes on a slow machine."""


class Work(QObject):
    """What is measured on one picture.

    Attributes
    ----------
    undo : QUndoStack
        History of the tools on the picture.
    answer : Answer or None
        What is known of the picture; None until it is reconstructed.
    chosen : int
        Key of the tool that is chosen; 0 for none.
    grip : str
        Which of its grips the keys move; empty for none.

    Signals
    -------
    picture_changed()
        Another picture, or another depth of it.
    changed()
        Tools, choice or figures are others.
    busy_changed(bool)
        Whether something is being measured.
    refused(str)
        A sentence: why the picture cannot be measured on.
    proposed(object)
        A Proposal, or None where nothing known is pressed.
    """

    picture_changed = Signal()
    changed = Signal()
    busy_changed = Signal(bool)
    refused = Signal(str)
    proposed = Signal(object)

    def __init__(self, parent: QObject | None = None) -> None:
        super().__init__(parent)
        self.undo = QUndoStack(self)
        self.taken: Taken | None = None
        self.answer: Answer | None = None
        self.chosen = 0
        self.grip = ""
        self._sheet = Sheet()
        self._preview: Sheet | None = None
        self._reconstructor: Reconstructor | None = None
        self._propose = False
        self._busy = False
        self._worker: NewestWins[Question | None, Answer | None] | None = None
        self._timer = QTimer(self)
        self._timer.setInterval(POLL_MS)
        self._timer.timeout.connect(self._poll)

    # What is known

    @property
    def sheet(self) -> Sheet:
        """The tools, as a drag in progress has them."""
        return self._sheet if self._preview is None else self._preview

    @property
    def heightmap(self) -> HeightMap | None:
        """Depth of the picture."""
        return None if self.answer is None else self.answer.heightmap

    @property
    def results(self) -> Mapping[int, ToolResult | str]:
        """What the tools say, by their keys; those of tools that were just moved are missing."""
        return MappingProxyType({}) if self.answer is None else self.answer.results

    @property
    def tool(self) -> Tool | None:
        """The tool that is chosen."""
        return self.sheet.tool(self.chosen)

    @property
    def result(self) -> ToolResult | None:
        """What the chosen tool says, as it is now."""
        found = self.results.get(self.chosen)
        return found if isinstance(found, ToolResult) and found.tool == self.tool else None

    @property
    def busy(self) -> bool:
        """Whether something is being measured."""
        return self._busy

    # The picture

    def use(self, reconstructor: Reconstructor | None) -> None:
        """Measure with this calibration from now on."""
        self._reconstructor = reconstructor
        self.answer = None
        self.picture_changed.emit()
        self.changed.emit()
        self._ask()

    def take(self, taken: Taken | None, *, propose: bool = False) -> None:
        """Measure on another picture, or on none; it begins without tools."""
        self.taken, self.answer, self._preview = taken, None, None
        self.undo.clear()
        self._sheet = Sheet()
        self.chosen, self.grip = 0, ""
        self._propose = propose and taken is not None
        self.picture_changed.emit()
        self.changed.emit()
        self._ask()

    def propose(self) -> None:
        """Ask what is pressed."""
        self._propose = True
        self._ask()

    # Tools

    def add(self, tool: Tool) -> int:
        """Put a tool on the picture and choose it; return its key."""
        self._preview = None
        key = self._sheet.next_key()
        text = tr("add {tool}").format(tool=kind_label(tool.name))
        self.undo.push(_Edit(self, self._sheet.added(tool), key, text))
        return key

    def change(self, key: int, tool: Tool, *, nudge: bool = False) -> None:
        """Put another tool in the place of one; nudges of one grip are one step of the history."""
        self._preview = None
        text = tr("move {tool}").format(tool=kind_label(tool.name))
        self.undo.push(_Edit(self, self._sheet.changed(key, tool), key, text, nudge=nudge))

    def remove(self, key: int) -> None:
        """Take a tool off the picture."""
        self._preview = None
        tool = self._sheet.tool(key)
        if tool is not None:
            text = tr("remove {tool}").format(tool=kind_label(tool.name))
            self.undo.push(_Edit(self, self._sheet.without(key), 0, text))

    def drag(self, grip: str, to_mm: tuple[float, float]) -> None:
        """Show the chosen tool with a grip elsewhere, before it is let go."""
        tool = self._sheet.tool(self.chosen)
        if tool is not None:
            self._preview = self._sheet.changed(self.chosen, moved(tool, grip, to_mm))
            self.changed.emit()
            self._ask()

    def drop(self, grip: str, to_mm: tuple[float, float]) -> None:
        """Leave the chosen tool's grip there."""
        tool = self._sheet.tool(self.chosen)
        if tool is not None:
            self.change(self.chosen, moved(tool, grip, to_mm))

    def nudge(self, dx_mm: float, dy_mm: float) -> bool:
        """Move the grip that has the keys; whether there is one."""
        tool = self._sheet.tool(self.chosen)
        held = next((g for g in grips_of(tool) if g.name == self.grip), None) if tool else None
        if tool is None or held is None:
            return False
        x, y = held.at_mm
        self.change(self.chosen, moved(tool, self.grip, (x + dx_mm, y + dy_mm)), nudge=True)
        return True

    def choose(self, key: int, grip: str = "") -> None:
        """Choose a tool, and the grip that the keys move: its first where none is named."""
        tool = self.sheet.tool(key)
        self.chosen = 0 if tool is None else key
        grips = () if tool is None else grips_of(tool)
        self.grip = grip or (grips[0].name if grips else "")
        self.changed.emit()

    def set_sheet(self, sheet: Sheet, key: int) -> None:
        """Show another state of the sheet, by the history."""
        self._sheet, self._preview = sheet, None
        self.choose(key, self.grip if key == self.chosen else "")
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
        maker, question = self._reconstructor, None
        if maker is not None and self.taken is not None:
            question = Question(
                maker.calibration, maker.model, self.taken, self.sheet, self._propose
            )
        if self._worker is None:
            if question is None:
                return
            self._worker = NewestWins(Measuring(), name="measure")
        self._worker.ask(question)  # without one, it lets go of the last picture
        self._timer.start()
        if question is not None:
            self._say_busy(True)

    def _poll(self) -> None:
        assert self._worker is not None
        answered = self._worker.take()
        if self._worker.idle:
            self._timer.stop()
            self._say_busy(False)
        if answered is None or answered.question is None:
            return
        if not self._is_of_now(answered.question):
            return
        if isinstance(answered.error, InputError):
            self.refused.emit(str(answered.error))
        elif answered.error is not None:
            _LOG.error("Measuring failed", exc_info=answered.error)
            kind = type(answered.error).__name__
            self.refused.emit(tr("A fault of this program: {k}; the log has it.").format(k=kind))
        elif answered.answer is not None:
            self._show(answered.question, answered.answer)

    def _is_of_now(self, question: Question) -> bool:
        """Return whether a question is of the picture and the calibration that are in use."""
        maker = self._reconstructor
        return (
            maker is not None
            and question.calibration is maker.calibration
            and question.model == maker.model
            and question.taken is self.taken
        )

    def _show(self, question: Question, answer: Answer) -> None:
        before, self.answer = self.answer, answer
        if before is None or before.heightmap is not answer.heightmap:
            self.picture_changed.emit()
        self.changed.emit()
        if question.propose and self._propose:
            self._propose = False
            self._on_proposal(answer.proposal)

    def _on_proposal(self, proposal: Proposal | None) -> None:
        if proposal is not None:
            kind = {"ball": Ball, "cylinder": Cylinder, "cuboid": Cuboid}
            self.add(kind[proposal.candidates[0]](proposal.at_mm))
        self.proposed.emit(proposal)

    def _say_busy(self, busy: bool) -> None:
        if busy != self._busy:
            self._busy = busy
            self.busy_changed.emit(busy)


class _Edit(QUndoCommand):
    """One change of the tools on the picture."""

    def __init__(
        self, work: Work, after: Sheet, key: int, text: str, *, nudge: bool = False
    ) -> None:
        super().__init__(text)
        self._work = work
        self._before, self._key_before = work.sheet, work.chosen
        self._after, self._key = after, key
        self._nudged = f"{key}/{work.grip}" if nudge else ""

    def redo(self) -> None:
        """Make the change."""
        self._work.set_sheet(self._after, self._key)

    def undo(self) -> None:
        """Take it back."""
        self._work.set_sheet(self._before, self._key_before)

    def id(self) -> int:
        """Return the kind of command that may be joined with the one before it."""
        return 1 if self._nudged else -1

    def mergeWith(self, other: QUndoCommand) -> bool:
        """Join nudges of one grip."""
        assert isinstance(other, _Edit)
        if other._nudged != self._nudged:
            return False
        self._after = other._after
        return True
