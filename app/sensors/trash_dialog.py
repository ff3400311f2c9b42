"""The trash: removed calibrations, each of which can be restored."""

from __future__ import annotations

from collections.abc import Callable

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QDialog, QDialogButtonBox, QPushButton, QVBoxLayout, QWidget

from app.sensors.model import Cell, CellsModel, validated_cell
from app.sensors.tables import CellsTable
from app.theme.icons import icon
from app.widgets.label import PlainLabel
from app.widgets.naming import named
from app.workspace.trash import Removal
from gelpolight_core.translation import tr


class TrashModel(CellsModel):
    """One row for each removed calibration."""

    def __init__(self) -> None:
        super().__init__((tr("Sensor"), tr("Name"), tr("Removed"), tr("Validation")))
        self.removals: tuple[Removal, ...] = ()

    def set_removals(self, removals: tuple[Removal, ...]) -> None:
        """Show other calibrations."""
        self.beginResetModel()
        self.removals = removals
        self._cells = [_cells(removal) for removal in removals]
        self.endResetModel()


def _cells(removal: Removal) -> tuple[Cell, ...]:
    entry = removal.entry
    when = removal.when.astimezone()
    return (
        Cell(removal.old_path.parent.name if entry.summary is None else entry.serial),
        Cell(entry.name, tip=str(removal.trashed)),
        Cell(f"{when:%Y-%m-%d %H:%M}", key=when.timestamp()),
        validated_cell(entry),
    )


class TrashDialog(QDialog):
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
        super().__init__(parent)
        named(self, "trash", tr("Trash"))
        self.setWindowTitle(tr("Trash"))
        self.resize(720, 360)
        self._removals, self._restore = removals, restore
        self._model = TrashModel()
        self.table = CellsTable(self._model, "trash.table", tr("Removed calibrations"), self)
        self.table.sortByColumn(2, Qt.SortOrder.DescendingOrder)
        self.table.selectionModel().selectionChanged.connect(self._enable)
        self.table.doubleClicked.connect(lambda _: self.restore_chosen())
        self._empty = PlainLabel(tr("The trash is empty."), self)
        buttons = QDialogButtonBox(QDialogButtonBox.StandardButton.Close, self)
        self.restore_button = named(
            QPushButton(icon("undo"), tr("Restore"), self),
            "trash.restore",
            tr("Restore the selected calibration"),
        )
        buttons.addButton(self.restore_button, QDialogButtonBox.ButtonRole.ActionRole)
        self.restore_button.clicked.connect(self.restore_chosen)
        buttons.rejected.connect(self.reject)
        column = QVBoxLayout(self)
        column.addWidget(self._empty)
        column.addWidget(self.table, 1)
        column.addWidget(buttons)

    def refresh(self) -> None:
        """Show the present content. The first row is selected."""
        removals = self._removals()
        self._model.set_removals(removals)
        self._empty.setVisible(not removals)
        self.table.setVisible(bool(removals))
        self.table.selectRow(0)
        self._enable()

    def restore_chosen(self) -> None:
        """Restore the selected calibration."""
        row = self.table.chosen_row()
        if row is not None:
            self._restore(self._model.removals[row])
            self.refresh()

    def _enable(self) -> None:
        self.restore_button.setEnabled(self.table.chosen_row() is not None)
