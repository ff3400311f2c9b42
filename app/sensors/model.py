"""The lists of calibrations and of sessions as tables."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from PySide6.QtCore import QAbstractTableModel, QModelIndex, QPersistentModelIndex, Qt

from app.theme import theme
from app.theme.icons import icon
from app.widgets.label import plain_tip
from app.workspace.entries import Entry
from app.workspace.sessions import SessionEntry
from gelpolight_core.quality import verdict_word
from gelpolight_core.translation import tr

Index = QModelIndex | QPersistentModelIndex


@dataclass(frozen=True, slots=True)
class Cell:
    """Content of one cell."""

    text: str
    icon: str = ""
    role: str = ""
    tip: str = ""
    key: Any = ""


class CellsModel(QAbstractTableModel):
    """Rows of cells under titles.

    Parameters
    ----------
    titles : tuple of str
        Column headers.
    """

    def __init__(self, titles: tuple[str, ...]) -> None:
        super().__init__()
        self._titles = titles
        self._cells: list[tuple[Cell, ...]] = []

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


class LibraryModel(CellsModel):
    """One row for each calibration.

    Parameters
    ----------
    oldest_days : callable
        Returns the maximum age; older calibrations are marked.
    """

    def __init__(self, oldest_days: Callable[[], float]) -> None:
        super().__init__(
            (
                "",
                tr("Sensor"),
                tr("Created"),
                tr("Age"),
                tr("Verdict"),
                tr("Validation"),
                tr("Model"),
                tr("Name"),
            )
        )
        self._oldest_days = oldest_days
        self._entries: tuple[Entry, ...] = ()

    def set_entries(self, entries: tuple[Entry, ...]) -> None:
        """Show other calibrations."""
        now = datetime.now(UTC)
        self.beginResetModel()
        self._entries = entries
        self._cells = [cells_of(entry, now, self._oldest_days()) for entry in entries]
        self.endResetModel()

    def entry(self, row: int) -> Entry:
        """Return the calibration of a row."""
        return self._entries[row]


class SessionsModel(CellsModel):
    """One row for each session."""

    def __init__(self) -> None:
        super().__init__((tr("Sensor"), tr("Session"), tr("Images"), tr("Last changed")))
        self._entries: tuple[SessionEntry, ...] = ()

    def set_entries(self, entries: tuple[SessionEntry, ...]) -> None:
        """Show other sessions."""
        self.beginResetModel()
        self._entries = entries
        self._cells = [session_cells(entry) for entry in entries]
        self.endResetModel()

    def entry(self, row: int) -> SessionEntry:
        """Return the session of a row."""
        return self._entries[row]


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
    if entry.summary is None:
        nothing = Cell("")
        return (
            _in_use(entry),
            Cell(entry.serial),
            nothing,
            nothing,
            Cell(tr("Broken"), "broken", "fail", entry.broken, key=3),
            nothing,
            nothing,
            Cell(entry.name, tip=str(entry.path)),
        )
    verdict = entry.summary.verdict
    return (
        _in_use(entry),
        Cell(entry.serial),
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
    if trial is not None and not entry.validation_note:
        return Cell(tr("failed"), "fail", "fail", trial.indenter, key=1)
    return Cell(tr("not validated"), "", "muted", entry.validation_note, key=0)


def _in_use(entry: Entry) -> Cell:
    return Cell("", "use", "accent", tr("In use"), key=1) if entry.in_use else Cell("", key=0)
