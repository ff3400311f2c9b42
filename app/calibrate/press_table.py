"""The presses of a validation as a table: state and errors of each press."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from functools import partial

from PySide6.QtWidgets import QHeaderView, QWidget

from app.widgets.actions import push_button
from app.widgets.cells_table import CellsTable, TableCell
from app.widgets.icons import tool_icon
from app.widgets.layout import hbox, vbox
from app.widgets.widget_names import set_names
from gelpolight_core.lab.reference_press import LENGTHS, ReferencePress
from gelpolight_core.lab.validation_trial import object_name, press_lines

HEIGHT = 124
"""Height of three rows with their titles. More rows are scrolled."""


class PressTable(QWidget):
    """Shows the presses. The selected one can be made again or left out.

    Parameters
    ----------
    on_retake, on_leave_out : callable
        Called with the selected press.
    """

    def __init__(
        self,
        *,
        on_retake: Callable[[ReferencePress], object],
        on_leave_out: Callable[[ReferencePress], object],
    ) -> None:
        super().__init__()
        set_names(self, "validation.presses", "Presses")
        self._presses: Sequence[ReferencePress] = ()
        self._missing: Collection[str] = ()
        self._limits_percent = 0.0, 0.0
        titles = "Press", "Size", "Depth"
        self.rows = CellsTable[ReferencePress](
            "validation.table", "Presses and their errors", titles, self._cells, lambda p: p.file
        )
        self.rows.setSortingEnabled(False)
        self.rows.sorted.sort(-1)
        self.rows.setFixedHeight(HEIGHT)
        header = self.rows.horizontalHeader()
        header.setStretchLastSection(False)
        header.setSectionResizeMode(2, QHeaderView.ResizeMode.Stretch)
        self._buttons = [
            push_button(f"validation.{name}", text, partial(self._act, act))
            for name, text, act in (
                ("retake", "Re&take", on_retake),
                ("leave_out", "&Leave out", on_leave_out),
            )
        ]
        self.rows.selectionModel().selectionChanged.connect(lambda *_: self._enable())
        vbox(self.rows, hbox(*self._buttons), of=self, margins=0)

    def show_presses(
        self,
        presses: Sequence[ReferencePress],
        missing: Collection[str],
        limits_percent: tuple[float, float],
    ) -> None:
        """Show the presses, of which those whose image is missing are still to be made."""
        self._presses, self._missing = presses, missing
        self._limits_percent = limits_percent
        self.rows.show_items(presses)
        self.setVisible(bool(presses))
        self._enable()

    def _act(self, act: Callable[[ReferencePress], object]) -> None:
        if (press := self.rows.chosen()) is not None:
            act(press)

    def _enable(self) -> None:
        for button in self._buttons:
            button.setEnabled(self.rows.chosen() is not None)

    def _cells(self, press: ReferencePress) -> tuple[TableCell, ...]:
        truth = press.truth
        number = [listed.file for listed in self._presses].index(press.file) + 1
        depth = f" x {truth.height_mm:g}" if truth.height_mm else ""
        size = f"{number}: {truth.size_mm:g}{depth}"
        name = TableCell(size, tool_icon(truth.shape), tip=object_name(truth))
        is_missing = press.file in self._missing
        if is_missing or not press.outcome:
            state = "to press" if is_missing else "measuring"
            return name, TableCell(state, role="muted"), TableCell("")
        tip, role = press_lines(press, self._limits_percent)
        quantities = press.quantities(self._limits_percent)
        if not quantities:
            return name, TableCell("failed", role=role, tip=tip), TableCell("")
        errors = (quantities[direction].error_percent for direction in LENGTHS)
        texts = ("" if error is None else f"{error:+.1f} %" for error in errors)
        return (name, *(TableCell(text, role=role, tip=tip, right=True) for text in texts))
