"""The dialog of a report: choose, run in the background, filter the table, save."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from PySide6.QtWidgets import QHeaderView, QLineEdit, QTableWidgetItem, QVBoxLayout, QWidget

from app.context.context import AppContext
from app.tools.report import ToolReport
from app.tools.work_dialog import WorkDialog
from app.widgets.inputs import ComboBox
from app.widgets.label import plain_tip
from app.widgets.naming import named
from gelpolight_core.translation import tr


class ReportDialog(WorkDialog):
    """Runs a report and shows its table. Live processing rests meanwhile.

    Parameters
    ----------
    report : ToolReport
        What is run.
    context : AppContext
        Settings, and the request to rest.
    parent : QWidget, optional
        Owner.
    """

    def __init__(
        self, report: ToolReport, *, context: AppContext, parent: QWidget | None = None
    ) -> None:
        start = tr("&Run"), tr("Run")
        super().__init__(report.name, report.title, start=start, context=context, parent=parent)
        self.report = report
        self.resize(980, 620)
        self._make()
        self._lay_out()
        self.say(report.intro)
        self.allow()

    def _make(self) -> None:
        name = self.report.name
        self.choice = named(ComboBox(), f"{name}.choice", tr("What to run"))
        for label, data in self.report.choices():
            self.choice.addItem(label, data)
        self.filter = named(QLineEdit(), f"{name}.filter", tr("Filter the table"))
        self.filter.setPlaceholderText(tr("Show rows that contain…"))
        self.filter.setClearButtonEnabled(True)
        self.filter.textChanged.connect(self._filter)
        heads = list(self.report.heads)
        self.table = self.result_table(heads)
        mode = QHeaderView.ResizeMode
        self.table.horizontalHeader().setSectionResizeMode(mode.Interactive)
        self.table.horizontalHeader().setSectionResizeMode(len(heads) - 1, mode.Stretch)

    def _lay_out(self) -> None:
        column = QVBoxLayout(self)
        column.addLayout(self.button_row(self.choice))
        column.addWidget(self.filter)
        column.addWidget(self.table, 1)
        column.addLayout(self.foot_row())

    def run(self) -> None:
        """Run the report in the background."""
        if self.jobs.busy:
            return
        report, choice = self.report, self.choice.currentData()

        def work(progress: Callable[[float], None]) -> Any:
            return report.run(choice, lambda _what, share: progress(share))

        self.submit(report.title, work)

    def show_result(self, result: Any) -> None:
        """Show the table of a result."""
        rows = self.report.rows(result)
        self.table.setRowCount(len(rows))
        for number, row in enumerate(rows):
            self._show_row(number, row)
        last = self.table.columnCount() - 1
        for column in range(last):
            self.table.resizeColumnToContents(column)
            self.table.setColumnWidth(column, min(self.table.columnWidth(column), 380))
        self.say(self.report.summary(result))
        self._filter(self.filter.text())

    def _show_row(self, number: int, row: Sequence[str]) -> None:
        for column, text in enumerate(row):
            item = QTableWidgetItem(text)
            item.setToolTip(plain_tip(text))
            self.table.setItem(number, column, item)

    def _filter(self, text: str) -> None:
        """Show the rows that contain a text in any column."""
        wanted = text.casefold()
        for row in range(self.table.rowCount()):
            cells = [self.table.item(row, c) for c in range(self.table.columnCount())]
            found = any(wanted in cell.text().casefold() for cell in cells if cell is not None)
            self.table.setRowHidden(row, not found)

    def files_of(self, result: Any, folder: Path) -> Sequence[Path]:
        """Write the report into a folder; return the files."""
        return self.report.write(result, folder)
