"""The tables on the Sensors page, and their cells for calibrations and sessions."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime

from PySide6.QtCore import Qt
from PySide6.QtWidgets import QWidget

from app.widgets.actions import action_button, make_action
from app.widgets.cells_table import Cell, CellsTable
from app.widgets.layout import hbox, vbox
from app.widgets.meaning import heading
from app.widgets.naming import named
from app.workspace.entries import Entry
from app.workspace.sessions import SessionEntry
from gelpolight_core.finding import verdict_word
from gelpolight_core.translation import tr


def library_titles() -> tuple[str, ...]:
    """Return the titles of the columns of :func:`cells_of`."""
    first = "", tr("Sensor"), tr("Created"), tr("Age"), tr("Verdict")
    return (*first, tr("Validation"), tr("Model"), tr("Name"))


def session_titles() -> tuple[str, ...]:
    """Return the titles of the columns of :func:`session_cells`."""
    return tr("Sensor"), tr("Session"), tr("Images"), tr("Last changed")


def session_cells(entry: SessionEntry) -> tuple[Cell, ...]:
    """Return the cells of a session's row."""
    return (
        Cell(entry.serial),
        Cell(entry.folder.name, tip=str(entry.folder)),
        Cell(str(entry.images), key=entry.images),
        Cell(f"{entry.changed.astimezone():%Y-%m-%d %H:%M}", key=entry.changed.timestamp()),
    )


def cells_of(entry: Entry, now: datetime, oldest_days: float) -> tuple[Cell, ...]:
    """Return the cells of a calibration's row."""
    first, nothing = (_in_use(entry), Cell(entry.serial)), Cell("")
    if entry.summary is None:
        broken = Cell(tr("Broken"), "broken", "fail", entry.broken, key=3)
        name = Cell(entry.name, tip=str(entry.path))
        return (*first, nothing, nothing, broken, nothing, nothing, name)
    verdict = entry.summary.verdict
    return (
        *first,
        made_cell(entry),
        age_cell(entry.age_days(now), oldest_days),
        Cell(
            verdict_word(verdict),
            verdict.value,
            verdict.value,
            key=("pass", "warn", "fail").index(verdict.value),
        ),
        validated_cell(entry),
        Cell(entry.summary.model),
        Cell(entry.name, tip=f"{entry.path}\n{entry.summary.identity}"),
    )


def made_cell(entry: Entry) -> Cell:
    """Return the local time at which a calibration was made."""
    made = entry.created
    if made is None:
        return Cell(tr("unknown"), key=0.0)
    local = made.astimezone()
    return Cell(f"{local:%Y-%m-%d %H:%M}", key=made.timestamp())


def age_cell(age_days: float | None, oldest_days: float) -> Cell:
    """Return an age as text, marked if it is above the limit."""
    if age_days is None:
        return Cell("", key=0.0)
    if age_days < 1.0:
        text = tr("today")
    else:
        text = tr("{n} d").format(n=int(age_days))
    if age_days <= oldest_days:
        return Cell(text, key=age_days)
    tip = tr(
        "Older than {n:.0f} days. Gel hardens and yellows: validate this calibration, or "
        "calibrate again."
    )
    return Cell(text, "stale", "stale", tip.format(n=oldest_days), key=age_days)


def validated_cell(entry: Entry) -> Cell:
    """Return the validation state of a calibration."""
    trial = entry.validation
    if entry.validated and trial is not None:
        tip = tr("{what}, {when}").format(what=trial.indenter, when=trial.when)
        return Cell(tr("validated"), "validated", "pass", tip, key=2)
    if trial is not None:
        return Cell(tr("failed"), "fail", "fail", trial.indenter, key=1)
    return Cell(tr("not validated"), "", "muted", key=0)


def _in_use(entry: Entry) -> Cell:
    return Cell("", "use", "accent", tr("In use"), key=1) if entry.in_use else Cell("", key=0)


class SessionsBox(QWidget):
    """A table of sessions, and a button to continue the selected one.

    Parameters
    ----------
    on_continue : callable
        Called with the folder of the session.
    """

    def __init__(self, on_continue: Callable[[str], object]) -> None:
        super().__init__()
        named(self, "sensors.sessions", tr("Sessions"))
        self._on_continue = on_continue
        self.table = CellsTable(
            "sensors.sessions.table",
            tr("Sessions"),
            session_titles(),
            session_cells,
            lambda session: session.folder,
        )
        self.table.sortByColumn(0, Qt.SortOrder.AscendingOrder)
        self.table.doubleClicked.connect(lambda _: self._continue())
        self.table.selectionModel().selectionChanged.connect(self._enable)
        tip = tr("Open the selected session with all its images and decisions")
        self.go_on = make_action(
            self, "sensors.go_on", tr("&Continue calibration"), self._continue, tip=tip
        )
        row = hbox(heading(tr("Sessions")), None, action_button(self.go_on))
        vbox(row, (self.table, 1), of=self, margins=(0, 8, 0, 0))

    def set_entries(self, entries: tuple[SessionEntry, ...]) -> None:
        """Show these sessions. The selection is kept."""
        self.table.show_items(entries)
        self._enable()

    def _enable(self) -> None:
        self.go_on.setEnabled(self.table.chosen() is not None)

    def _continue(self) -> None:
        session = self.table.chosen()
        if session is not None:
            self._on_continue(str(session.folder))
