"""A table of items, each with its cells."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

from PySide6.QtCore import (
    QAbstractTableModel,
    QItemSelectionModel,
    QModelIndex,
    QPersistentModelIndex,
    QSortFilterProxyModel,
    Qt,
    Signal,
)
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QTableView

from app.widgets import theme

from .icons import icon
from .label import plain_tip
from .widget_names import set_names

Index = QModelIndex | QPersistentModelIndex
ItemT = TypeVar("ItemT")


@dataclass(frozen=True, slots=True)
class TableCell:
    """Content of one cell.

    Attributes
    ----------
    text, tip : str
        Text, and tooltip.
    icon, role : str
        Icon, and colour of both.
    key : object
        Sort key of the row. Default: the text.
    right : bool
        Whether the text is at the right, as of numbers.
    """

    text: str
    icon: str = ""
    role: str = ""
    tip: str = ""
    key: Any = None
    right: bool = False


class CellsModel(QAbstractTableModel):
    """Rows of cells under titles, one column of which can be edited.

    Signals
    -------
    edited(int, str)
        The user has entered a text in this row.
    """

    edited = Signal(int, str)

    def __init__(self, titles: tuple[str, ...], editable: int) -> None:
        super().__init__()
        self._titles, self._editable = titles, editable
        self._cells: list[tuple[TableCell, ...]] = []

    def show_cells(self, cells: list[tuple[TableCell, ...]]) -> None:
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
            case Qt.ItemDataRole.DisplayRole | Qt.ItemDataRole.EditRole:
                return cell.text
            case Qt.ItemDataRole.TextAlignmentRole if cell.right:
                return int(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
            case Qt.ItemDataRole.DecorationRole if cell.icon:
                return icon(cell.icon, cell.role)
            case Qt.ItemDataRole.ForegroundRole if cell.role:
                return theme.colour(cell.role)
            case Qt.ItemDataRole.ToolTipRole:
                return plain_tip(cell.tip) or None
            case Qt.ItemDataRole.AccessibleTextRole:
                return cell.text or cell.tip
            case Qt.ItemDataRole.UserRole:
                return cell.text if cell.key is None else cell.key
        return None

    def flags(self, index: Index) -> Qt.ItemFlag:
        """Return what can be done with a cell."""
        flags = super().flags(index)
        return flags | Qt.ItemFlag.ItemIsEditable if index.column() == self._editable else flags

    def setData(self, index: Index, value: Any, role: int = Qt.ItemDataRole.EditRole) -> bool:
        """Report another text. The owner of the data shows it."""
        if value != self._cells[index.row()][index.column()].text:
            self.edited.emit(index.row(), str(value))
        return True


class CellsTable(QTableView, Generic[ItemT]):
    """Shows items, which can be selected. A click on a column header sorts them.

    Its actions are its context menu.

    Parameters
    ----------
    name, accessible : str
        Object name and text for screen readers.
    titles : tuple of str
        Titles of the columns.
    cells : callable
        Returns the cells of an item.
    place : callable
        Returns the path or the number of an item, by which it stays selected.
    editable : int, optional
        Column of which the user can edit the text.

    Signals
    -------
    edited(object, str)
        Item, and the text that the user has entered.
    """

    edited = Signal(object, str)

    def __init__(
        self,
        name: str,
        accessible: str,
        titles: tuple[str, ...],
        cells: Callable[[ItemT], tuple[TableCell, ...]],
        place: Callable[[ItemT], Any],
        *,
        editable: int = -1,
    ) -> None:
        super().__init__()
        set_names(self, name, accessible)
        self._cells, self._place = cells, place
        self._items: Sequence[ItemT] = ()
        self._model = CellsModel(titles, editable)
        self._model.edited.connect(lambda row, text: self.edited.emit(self._items[row], text))
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
        self.setContextMenuPolicy(Qt.ContextMenuPolicy.ActionsContextMenu)
        self.verticalHeader().hide()
        self.verticalHeader().setDefaultSectionSize(30)
        header = self.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        header.setStretchLastSection(True)
        header.setHighlightSections(False)

    def show_items(self, items: Sequence[ItemT]) -> None:
        """Show other items. The selected ones stay selected."""
        places = [self._place(item) for item in self.selected]
        self._items = items
        self._model.show_cells([self._cells(item) for item in items])
        self.choose(*places)

    def choose(self, *places: Any) -> None:
        """Select the items with these paths or numbers."""
        self.clearSelection()
        all_places = [self._place(item) for item in self._items]
        select = QItemSelectionModel.SelectionFlag
        for place in places:
            if place in all_places:
                index = self.sorted.mapFromSource(self._model.index(all_places.index(place), 0))
                self.selectionModel().setCurrentIndex(index, select.Select | select.Rows)

    @property
    def shown(self) -> tuple[ItemT, ...]:
        """The items in the order of the rows."""
        return tuple(self._item(self.sorted.index(row, 0)) for row in range(len(self._items)))

    @property
    def selected(self) -> tuple[ItemT, ...]:
        """The selected items, in the order of the rows."""
        rows = self.selectionModel().selectedRows()
        return tuple(map(self._item, sorted(rows, key=lambda index: index.row())))

    def chosen(self) -> ItemT | None:
        """Return the selected item, the first of several."""
        return next(iter(self.selected), None)

    def _item(self, index: QModelIndex) -> ItemT:
        return self._items[self.sorted.mapToSource(index).row()]
