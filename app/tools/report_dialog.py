"""The dialog of a report: choose, run in the background, filter the table, save."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from PySide6.QtWidgets import (
    QAbstractItemView,
    QDialog,
    QFileDialog,
    QHBoxLayout,
    QHeaderView,
    QLineEdit,
    QProgressBar,
    QPushButton,
    QTableWidget,
    QTableWidgetItem,
    QVBoxLayout,
    QWidget,
)

from app.context.context import AppContext
from app.services.jobs import Job, Jobs
from app.tools.report import ToolReport
from app.widgets.inputs import ComboBox
from app.widgets.label import PlainLabel, plain_tip
from app.widgets.meaning import show_meaning
from app.widgets.naming import named
from gelpolight_core.translation import tr


class ReportDialog(QDialog):
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
        super().__init__(parent)
        self.report, self.context = report, context
        named(self, report.name, report.title)
        self.setWindowTitle(report.title)
        self.resize(980, 620)
        self.jobs = Jobs(report.name, self)
        self.result_shown: Any = None
        self._make()
        self._lay_out()
        self.jobs.progressed.connect(self._show_work)
        self.jobs.refused.connect(lambda text: self._say(text, "warn"))
        self._say(report.intro)
        self._allow()

    def _make(self) -> None:
        name = self.report.name
        self.choice = named(ComboBox(), f"{name}.choice", tr("What to run"))
        for label, data in self.report.choices():
            self.choice.addItem(label, data)
        self.start = named(QPushButton(tr("&Run")), f"{name}.start", tr("Run"))
        self.start.setDefault(True)
        self.start.clicked.connect(self.run)
        self.stop = named(QPushButton(tr("Stop")), f"{name}.stop", tr("Stop"))
        self.stop.clicked.connect(self.jobs.cancel)
        self.save = named(QPushButton(tr("Save report…")), f"{name}.save", tr("Save the report"))
        self.save.clicked.connect(self.choose_folder)
        self.progress = named(QProgressBar(), f"{name}.progress", tr("Progress"))
        self.filter = named(QLineEdit(), f"{name}.filter", tr("Filter the table"))
        self.filter.setPlaceholderText(tr("Show rows that contain…"))
        self.filter.setClearButtonEnabled(True)
        self.filter.textChanged.connect(self._filter)
        heads = list(self.report.heads)
        self.table = named(QTableWidget(0, len(heads)), f"{name}.table", tr("Results"))
        self.table.setHorizontalHeaderLabels(heads)
        self.table.verticalHeader().hide()
        self.table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        mode = QHeaderView.ResizeMode
        self.table.horizontalHeader().setSectionResizeMode(mode.Interactive)
        self.table.horizontalHeader().setSectionResizeMode(len(heads) - 1, mode.Stretch)
        self.words = named(PlainLabel(), f"{name}.words", tr("Notes"))
        self.words.setWordWrap(True)

    def _lay_out(self) -> None:
        begin = QHBoxLayout()
        begin.addWidget(self.choice)
        begin.addWidget(self.progress, 1)
        begin.addWidget(self.start)
        begin.addWidget(self.stop)
        foot = QHBoxLayout()
        foot.addWidget(self.words, 1)
        foot.addWidget(self.save)
        column = QVBoxLayout(self)
        column.addLayout(begin)
        column.addWidget(self.filter)
        column.addWidget(self.table, 1)
        column.addLayout(foot)

    def run(self) -> None:
        """Run the report in the background."""
        if self.jobs.busy:
            return
        report, choice = self.report, self.choice.currentData()

        def work(tell: Callable[[float], None]) -> Any:
            return report.run(choice, lambda _what, share: tell(share))

        self._say("")
        self.context.requests.rest.emit(True)
        self.jobs.submit(
            Job(
                report.title,
                work,
                self.show_result,
                lambda text: self._say(text, "fail"),
                ended=lambda: self.context.requests.rest.emit(False),
            )
        )
        self._allow()

    def show_result(self, result: Any) -> None:
        """Show the table of a result."""
        self.result_shown = result
        rows = self.report.rows(result)
        self.table.setRowCount(len(rows))
        for number, row in enumerate(rows):
            self._show_row(number, row)
        last = self.table.columnCount() - 1
        for column in range(last):
            self.table.resizeColumnToContents(column)
            self.table.setColumnWidth(column, min(self.table.columnWidth(column), 380))
        self._say(self.report.summary(result))
        self._filter(self.filter.text())
        self._allow()

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

    def choose_folder(self) -> None:
        """Let the user choose a folder, and write the report into it."""
        chosen = QFileDialog.getExistingDirectory(
            self, tr("Folder for the report"), str(self.context.settings.last_folder)
        )
        if chosen:
            self.write(Path(chosen))

    def write(self, folder: Path) -> None:
        """Write the report in the background."""
        report, result = self.report, self.result_shown

        def done(written: Sequence[Path]) -> None:
            self._say(tr("Report saved: {file}").format(file=written[0]), "pass")

        self.jobs.submit(
            Job(
                tr("Writing the report"),
                lambda _tell: report.write(result, folder),
                done,
                lambda text: self._say(text, "fail"),
            )
        )

    def _say(self, text: str, role: str = "muted") -> None:
        self.words.setText(text)
        show_meaning(self.words, role)

    def _show_work(self, title: str, share: float) -> None:
        self.progress.setFormat(f"{title}  %p %" if title else "")
        self.progress.setValue(round(100.0 * share))
        self._allow()

    def _allow(self) -> None:
        busy = self.jobs.busy
        self.start.setEnabled(not busy)
        self.stop.setEnabled(busy)
        self.save.setEnabled(self.result_shown is not None and not busy)

    def reject(self) -> None:
        """Stop the work. Qt calls this for Escape and for every other way of closing."""
        working = self.jobs.busy
        self.jobs.close()
        if working:
            self.context.requests.rest.emit(False)
        super().reject()
