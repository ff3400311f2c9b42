"""The trash: removed calibrations, each of which can be restored."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QWidget

from app.sensors.tables import validated_cell
from app.widgets.buttons import push_button
from app.widgets.cells_table import Cell, CellsTable
from app.widgets.dialog import Dialog
from app.widgets.label import PlainLabel
from app.workspace.trash import Removal


def _cells(removal: Removal) -> tuple[Cell, ...]:
    entry = removal.entry
    when = removal.when.astimezone()
    return (
        Cell(removal.old_path.parent.name if entry.summary is None else entry.serial),
        Cell(entry.name, tip=str(removal.trashed)),
        Cell(f"{when:%Y-%m-%d %H:%M}", key=when.timestamp()),
        validated_cell(entry),
    )


class TrashDialog(Dialog):
    """Shows the trash.

    Parameters
    ----------
    removals : callable
        Returns what is in the trash.
    restore : callable
        Restores one.
    """

    def __init__(
        self,
        removals: Callable[[], tuple[Removal, ...]],
        restore: Callable[[Removal], None],
        parent: QWidget,
    ) -> None:
        super().__init__(parent, "trash", "Trash")
        self.resize(720, 360)
        self._removals, self._restore = removals, restore
        titles = "Sensor", "Name", "Removed", "Validation"
        self.table = CellsTable(
            "trash.table", "Removed calibrations", titles, _cells, lambda r: r.trashed
        )
        self.table.sortByColumn(2, Qt.SortOrder.DescendingOrder)
        self.table.selectionModel().selectionChanged.connect(self._enable)
        self.table.doubleClicked.connect(lambda _: self.restore_chosen())
        self._empty = PlainLabel("The trash is empty.", self)
        self.restore_button = push_button(
            "trash.restore",
            "Restore",
            self.restore_chosen,
            icon_name="undo",
            accessible="Restore the selected calibration",
        )
        self.fill(self._empty, (self.table, 1), add=(self.restore_button,))

    def refresh(self) -> None:
        """Show the present content. The first row is selected."""
        removals = self._removals()
        self.table.show_items(removals)
        self._empty.setVisible(not removals)
        self.table.setVisible(bool(removals))
        self.table.selectRow(0)
        self._enable()

    def restore_chosen(self) -> None:
        """Restore the selected calibration."""
        removal = self.table.chosen()
        if removal is not None:
            self._restore(removal)
            self.refresh()

    def _enable(self) -> None:
        self.restore_button.setEnabled(self.table.chosen() is not None)
