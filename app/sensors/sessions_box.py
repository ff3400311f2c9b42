"""The sessions of the library. Each can be continued."""

from __future__ import annotations

from pathlib import Path

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QHBoxLayout, QToolButton, QVBoxLayout, QWidget

from app.sensors.model import SessionsModel
from app.sensors.tables import CellsTable
from app.widgets.actions import make_action
from app.widgets.label import PlainLabel
from app.widgets.meaning import make_bold
from app.widgets.naming import named
from app.workspace.sessions import SessionEntry
from gelpolight_core.translation import tr


class SessionsBox(QWidget):
    """A table of sessions, and the actions on the selected one.

    Signals
    -------
    wanted(str)
        Folder of the session to continue.
    """

    wanted = Signal(str)

    def __init__(self, parent: QWidget) -> None:
        super().__init__(parent)
        named(self, "sensors.sessions", tr("Sessions"))
        self._model = SessionsModel()
        self.table = CellsTable(self._model, "sensors.sessions.table", tr("Sessions"), self)
        self.table.sortByColumn(0, Qt.SortOrder.AscendingOrder)
        self.table.doubleClicked.connect(lambda _: self._go_on())
        self.table.selectionModel().selectionChanged.connect(self._enable)
        self.go_on: QAction = make_action(
            self,
            "sensors.go_on",
            tr("&Continue calibration"),
            self._go_on,
            icon_name="calibrate",
            tip=tr("Open the selected session with all its images and decisions"),
        )
        button = named(QToolButton(self), "sensors.go_on.button", tr("Continue calibration"))
        button.setDefaultAction(self.go_on)
        button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        button.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        title = PlainLabel(tr("Sessions"), self)
        make_bold(title)
        title.setBuddy(self.table)
        head = QHBoxLayout()
        head.addWidget(title)
        head.addStretch(1)
        head.addWidget(button)
        column = QVBoxLayout(self)
        column.setContentsMargins(0, 6, 0, 0)
        column.addLayout(head)
        column.addWidget(self.table, 1)

    def set_entries(self, entries: tuple[SessionEntry, ...]) -> None:
        """Show these sessions. The selection is kept."""
        before = self._chosen()
        self._model.set_entries(entries)
        self.table.clearSelection()
        for row in range(self.table.sorted.rowCount()):
            source = self.table.sorted.mapToSource(self.table.sorted.index(row, 0)).row()
            if self._model.entry(source).folder == before:
                self.table.selectRow(row)
        self._enable()

    def _chosen(self) -> Path | None:
        row = self.table.chosen_row()
        return None if row is None else self._model.entry(row).folder

    def _enable(self) -> None:
        self.go_on.setEnabled(self._chosen() is not None)

    def _go_on(self) -> None:
        folder = self._chosen()
        if folder is not None:
            self.wanted.emit(str(folder))
