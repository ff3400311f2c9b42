"""Common parts of the tables on the Sensors page."""

from __future__ import annotations

from PySide6.QtCore import QSortFilterProxyModel, Qt
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTableView, QWidget

from app.sensors.model import CellsModel
from app.widgets.naming import named

ROW_PX = 30


class CellsTable(QTableView):
    """Shows rows of cells, one of which can be selected. A click on a column header sorts them.

    Parameters
    ----------
    model : CellsModel
        The rows.
    name, accessible : str
        Object name and text for screen readers.
    parent : QWidget
        Parent widget.
    """

    def __init__(self, model: CellsModel, name: str, accessible: str, parent: QWidget) -> None:
        super().__init__(parent)
        named(self, name, accessible)
        self.sorted = QSortFilterProxyModel(self)
        self.sorted.setSourceModel(model)
        self.sorted.setSortRole(Qt.ItemDataRole.UserRole)
        self.setModel(self.sorted)
        self.setSortingEnabled(True)
        self.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        self.setSelectionMode(QAbstractItemView.SelectionMode.SingleSelection)
        self.setAlternatingRowColors(True)
        self.setShowGrid(False)
        self.setWordWrap(False)
        self.setTabKeyNavigation(False)
        self.verticalHeader().hide()
        self.verticalHeader().setDefaultSectionSize(ROW_PX)
        header = self.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        header.setStretchLastSection(True)
        header.setHighlightSections(False)

    def chosen_row(self) -> int | None:
        """Return the model row of the selection."""
        rows = self.selectionModel().selectedRows()
        return self.sorted.mapToSource(rows[0]).row() if rows else None
