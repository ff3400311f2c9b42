"""The presses of a validation as a table: state and errors of each press."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from dataclasses import dataclass
from functools import partial

from PySide6.QtWidgets import QHeaderView, QWidget

from app.widgets.buttons import push_button
from app.widgets.cells_table import Cell, CellsTable
from app.widgets.layout import hbox, vbox
from app.widgets.naming import named
from gelpolight_core.measurement.press import LENGTHS, Press
from gelpolight_core.measurement.trial import object_name, press_lines

HEIGHT = 124
"""Of three rows with their titles; more are scrolled."""


@dataclass(frozen=True, slots=True)
class Row:
    """A press in the table."""

    place: int
    press: Press
    missing: bool
    limits_percent: tuple[float, float]


class PressTable(QWidget):
    """Shows the presses. The selected one can be made again or left out.

    Parameters
    ----------
    on_retake, on_leave_out : callable
        Called with the selected press.
    """

    def __init__(
        self, *, on_retake: Callable[[Press], object], on_leave_out: Callable[[Press], object]
    ) -> None:
        super().__init__()
        named(self, "validation.presses", "Presses")
        self.rows = CellsTable[Row](
            "validation.table",
            "Presses and their errors",
            ("Press", "Size", "Depth"),
            _cells,
            lambda row: row.press.file,
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
        presses: Sequence[Press],
        missing: Collection[str],
        limits_percent: tuple[float, float],
    ) -> None:
        """Show the presses, of which those whose image is missing are still to be made."""
        rows = [
            Row(place, press, press.file in missing, limits_percent)
            for place, press in enumerate(presses, 1)
        ]
        self.rows.show_items(rows)
        self.setVisible(bool(rows))
        self._enable()

    def _act(self, act: Callable[[Press], object]) -> None:
        if (row := self.rows.chosen()) is not None:
            act(row.press)

    def _enable(self) -> None:
        for button in self._buttons:
            button.setEnabled(self.rows.chosen() is not None)


def _cells(row: Row) -> tuple[Cell, ...]:
    press, truth = row.press, row.press.truth
    depth = f" x {truth.height_mm:g}" if truth.height_mm else ""
    size = f"{row.place}: {truth.size_mm:g}{depth}"
    name = Cell(size, f"tool-{truth.shape}", tip=object_name(truth))
    if row.missing or not press.outcome:
        state = "to press" if row.missing else "measuring"
        return name, Cell(state, role="muted"), Cell("")
    tip, role = press_lines(press, row.limits_percent)
    quantities = press.quantities(row.limits_percent)
    if not quantities:
        return name, Cell("failed", role=role, tip=tip), Cell("")
    errors = (quantities[direction].error_percent for direction in LENGTHS)
    texts = ("" if error is None else f"{error:+.1f} %" for error in errors)
    return (name, *(Cell(text, role=role, tip=tip, right=True) for text in texts))
