"""The tables on the Sensors page: one row of cells for each thing in the library."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from PySide6.QtCore import (
    QAbstractTableModel,
    QModelIndex,
    QPersistentModelIndex,
    QSortFilterProxyModel,
    Qt,
)
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTableView

from app.theme import theme
from app.theme.icons import icon
from app.widgets.label import plain_tip
from app.widgets.naming import named

ROW_PX = 30
Index = QModelIndex | QPersistentModelIndex
Item = TypeVar("Item")


@dataclass(frozen=True, slots=True)
class Cell:
    """Content of one cell."""

    text: str
    icon: str = ""
    role: str = ""
    tip: str = ""
    key: Any = ""


class CellsModel(QAbstractTableModel):
    """Rows of cells under titles."""

    def __init__(self, titles: tuple[str, ...]) -> None:
        super().__init__()
        self._titles = titles
        self._cells: list[tuple[Cell, ...]] = []

    def show_cells(self, cells: list[tuple[Cell, ...]]) -> None:
        """Show other rows."""
        self.beginResetModel()
        self._cells = cells
        self.endResetModel()

    def rowCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008
        """Return the number of rows."""
        return 0 if parent.isValid() else len(self._cells)

    def columnCount(self, parent: Index = QModelIndex()) -> int:  # noqa: B008
        """Return the number of columns."""
        return 0 if parent.isValid() else len(self._titles)

    def headerData(
        self, section: int, orientation: Qt.Orientation, role: int = Qt.ItemDataRole.DisplayRole
    ) -> Any:
        """Return a column's title."""
        if orientation is Qt.Orientation.Horizontal and role == Qt.ItemDataRole.DisplayRole:
            return self._titles[section]
        return None

    def data(self, index: Index, role: int = Qt.ItemDataRole.DisplayRole) -> Any:
        """Return the content of a cell."""
        cell = self._cells[index.row()][index.column()]
        match role:
            case Qt.ItemDataRole.DisplayRole:
                return cell.text
            case Qt.ItemDataRole.DecorationRole if cell.icon:
                return icon(cell.icon, cell.role)
            case Qt.ItemDataRole.ForegroundRole if cell.role:
                return theme.colour(cell.role)
            case Qt.ItemDataRole.ToolTipRole:
                return plain_tip(cell.tip) or None
            case Qt.ItemDataRole.AccessibleTextRole:
                return cell.text or cell.tip
            case Qt.ItemDataRole.UserRole:
                return cell.key or cell.text
        return None


class CellsTable(QTableView, Generic[Item]):
    """Shows items, one of which can be selected. A click on a column header sorts them.

    Parameters
    ----------
    name, accessible : str
        Object name and text for screen readers.
    titles : tuple of str
        Titles of the columns.
    cells : callable
        Returns the cells of an item.
    place : callable
        Returns the path of an item, by which it stays selected.
    """

    def __init__(
        self, name: str, accessible: str, titles: tuple[str, ...],
        cells: Callable[[Item], tuple[Cell, ...]], place: Callable[[Item], Any],
    ) -> None:  # fmt: skip
        super().__init__()
        named(self, name, accessible)
        self._cells, self._place = cells, place
        self._items: Sequence[Item] = ()
        self._model = CellsModel(titles)
        self.sorted = QSortFilterProxyModel(self)
        self.sorted.setSourceModel(self._model)
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

    def show_items(self, items: Sequence[Item]) -> None:
        """Show other items. The selected one stays selected."""
        chosen = self.chosen()
        self._items = items
        self._model.show_cells([self._cells(item) for item in items])
        self.choose(None if chosen is None else self._place(chosen))

    def choose(self, place: Any) -> bool:
        """Select the item with this path. Return whether there is one."""
        places = [self._place(item) for item in self._items]
        if place not in places:
            self.clearSelection()
            return False
        index = self.sorted.mapFromSource(self._model.index(places.index(place), 0))
        self.selectRow(index.row())
        return True

    def chosen(self) -> Item | None:
        """Return the selected item."""
        rows = self.selectionModel().selectedRows()
        return self._items[self.sorted.mapToSource(rows[0]).row()] if rows else None
