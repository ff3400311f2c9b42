"""Dialog to edit the list of known indenters like a small spreadsheet."""

from __future__ import annotations

from PySide6.QtCore import Qt
from PySide6.QtWidgets import (
    QAbstractItemView,
    QComboBox,
    QHeaderView,
    QTableWidget,
    QTableWidgetItem,
    QWidget,
)

from app.measure.placing import INDENTERS, kind_label
from app.widgets.buttons import push_button
from app.widgets.dialog import Dialog, Kinds
from app.widgets.inputs import ComboBox
from app.widgets.label import PlainLabel
from app.widgets.layout import hbox
from app.widgets.meaning import show_meaning
from app.widgets.naming import named
from app.workspace.indenters import Indenter
from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.translation import tr

NAME, SHAPE, SIZE, SECOND, HEIGHT = range(5)


class IndentersDialog(Dialog):
    """Edits the list. Errors are shown below it, and an invalid list is not accepted.

    Attributes
    ----------
    indenters : tuple of Indenter
        The accepted list.
    """

    def __init__(self, indenters: tuple[Indenter, ...], parent: QWidget | None = None) -> None:
        kinds = Kinds.Save | Kinds.Cancel
        super().__init__(parent, "measure.indenters", tr("Known indenters"), kinds, once=True)
        self.resize(680, 480)
        self.indenters = indenters
        self.table = self._make_table()
        self.problem = named(
            PlainLabel(wrap=True), "measure.indenters.problem", tr("Errors in the list")
        )
        show_meaning(self.problem, "fail")
        add = push_button(
            "measure.indenters.add",
            tr("&Add"),
            lambda: self.add_row(Indenter(tr("New cylinder"), "cylinder", 5.0)),
            icon_name="add",
        )
        remove = push_button(
            "measure.indenters.remove", tr("&Remove"), self.remove_rows, icon_name="remove"
        )
        for button in (add, remove):
            button.setAutoDefault(False)
        text = tr(
            "All lengths are in mm. Depth is the height of the indenter from its face to "
            "its base, if it has one."
        )
        row = hbox(add, remove, None)
        self.fill(PlainLabel(text, wrap=True), self.table, row, self.problem)
        for indenter in indenters:
            self.add_row(indenter)
        self.table.setCurrentCell(0, NAME)

    def _make_table(self) -> QTableWidget:
        table = named(QTableWidget(0, 5), "measure.indenters.table", tr("Known indenters"))
        table.setHorizontalHeaderLabels(
            [tr("Name"), tr("Shape"), tr("Diameter or side"), tr("Other side"), tr("Depth")]
        )
        header = table.horizontalHeader()
        header.setSectionResizeMode(QHeaderView.ResizeMode.ResizeToContents)
        header.setSectionResizeMode(NAME, QHeaderView.ResizeMode.Stretch)
        table.verticalHeader().hide()
        table.setSelectionBehavior(QAbstractItemView.SelectionBehavior.SelectRows)
        table.setAlternatingRowColors(True)
        return table

    def add_row(self, indenter: Indenter) -> None:
        """Add an indenter at the end."""
        row = self.table.rowCount()
        self.table.insertRow(row)
        texts = {
            NAME: indenter.name,
            SIZE: f"{indenter.size_mm:g}",
            SECOND: "" if indenter.second_mm is None else f"{indenter.second_mm:g}",
            HEIGHT: "" if indenter.height_mm is None else f"{indenter.height_mm:g}",
        }
        for column, text in texts.items():
            item = QTableWidgetItem(text)
            if column != NAME:
                item.setTextAlignment(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
            self.table.setItem(row, column, item)
        shape = named(ComboBox(), f"measure.indenters.shape{row}", tr("Shape"))
        for name in INDENTERS:
            shape.addItem(kind_label(name), name)
        shape.setCurrentIndex(shape.findData(indenter.shape))
        self.table.setCellWidget(row, SHAPE, shape)
        self.table.setCurrentCell(row, NAME)

    def remove_rows(self) -> None:
        """Remove the selected indenters."""
        rows = {index.row() for index in self.table.selectedIndexes()}
        for row in sorted(rows, reverse=True):
            self.table.removeRow(row)

    def accept(self) -> None:
        """Accept the list, or show its errors."""
        try:
            found = tuple(self._indenter(row) for row in range(self.table.rowCount()))
        except InputError as error:
            self.problem.setText(str(error))
            return
        self.indenters = found
        super().accept()

    def _indenter(self, row: int) -> Indenter:
        name = self._text(row, NAME)
        shape = self.table.cellWidget(row, SHAPE)
        assert isinstance(shape, QComboBox)
        size = self._length(row, SIZE)
        if size is None:
            raise InputError(
                tr("The diameter or side in mm is missing"),
                where=tr("Indenter {name}").format(name=name),
                advice=Remedy.CORRECT_VALUE,
            )
        second = self._length(row, SECOND) if shape.currentData() == "cuboid" else None
        return Indenter(name, shape.currentData(), size, second, self._length(row, HEIGHT))

    def _text(self, row: int, column: int) -> str:
        item = self.table.item(row, column)
        return "" if item is None else item.text().strip()

    def _length(self, row: int, column: int) -> float | None:
        text = self._text(row, column)
        if not text:
            return None
        try:
            return float(text.replace(",", "."))
        except ValueError as error:
            raise InputError(
                tr("'{text}' is not a length in mm such as 5 or 3.5").format(text=text),
                where=tr("Indenter {name}").format(name=self._text(row, NAME)),
                advice=Remedy.CORRECT_VALUE,
            ) from error
