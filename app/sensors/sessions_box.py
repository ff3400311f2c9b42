"""The sessions of the library. Each can be continued."""

from __future__ import annotations

from PySide6.QtCore import Qt, Signal
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QToolButton, QWidget

from app.sensors.tables import CellsTable, session_cells, session_titles
from app.widgets.actions import make_action
from app.widgets.label import PlainLabel
from app.widgets.layout import hbox, vbox
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
        self.table = CellsTable(
            "sensors.sessions.table", tr("Sessions"), session_titles(), session_cells,
            lambda session: session.folder,
        )  # fmt: skip
        self.table.sortByColumn(0, Qt.SortOrder.AscendingOrder)
        self.table.doubleClicked.connect(lambda _: self._go_on())
        self.table.selectionModel().selectionChanged.connect(self._enable)
        self.go_on: QAction = make_action(
            self, "sensors.go_on", tr("&Continue calibration"), self._go_on, icon_name="calibrate",
            tip=tr("Open the selected session with all its images and decisions"),
        )  # fmt: skip
        button = named(QToolButton(self), "sensors.go_on.button", tr("Continue calibration"))
        button.setDefaultAction(self.go_on)
        button.setToolButtonStyle(Qt.ToolButtonStyle.ToolButtonTextBesideIcon)
        button.setFocusPolicy(Qt.FocusPolicy.StrongFocus)
        title = PlainLabel(tr("Sessions"), self)
        make_bold(title)
        title.setBuddy(self.table)
        vbox(hbox(title, None, button), (self.table, 1), of=self, margins=(0, 6, 0, 0))

    def set_entries(self, entries: tuple[SessionEntry, ...]) -> None:
        """Show these sessions. The selection is kept."""
        self.table.show_items(entries)
        self._enable()

    def _enable(self) -> None:
        self.go_on.setEnabled(self.table.chosen() is not None)

    def _go_on(self) -> None:
        session = self.table.chosen()
        if session is not None:
            self.wanted.emit(str(session.folder))
