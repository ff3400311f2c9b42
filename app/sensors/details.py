"""The tables of the Sensors page, and the details of the selected calibration."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
from pathlib import Path
from typing import Generic, TypeVar

from PySide6.QtCore import Qt
from PySide6.QtGui import QAction
from PySide6.QtWidgets import QTabWidget, QWidget

from app.program.calibration_entries import CalibrationEntry
from app.program.session_entries import SessionEntry
from app.widgets.actions import action_button, make_action
from app.widgets.cells_table import CellsTable, TableCell
from app.widgets.icons import icon
from app.widgets.label import MarkupLabel, PlainLabel, escaped
from app.widgets.layout import hbox, scroll_area, vbox
from app.widgets.quality_table import QualityTableWidget
from app.widgets.status_icon import StatusIcon, busy_bar
from app.widgets.text_roles import heading, stack_over_text
from app.widgets.time_chart import TimeChart
from app.widgets.widget_names import set_names
from gelpolight_core.base.finding import Verdict
from gelpolight_core.calibration.manifest import CalibrationSummary
from gelpolight_core.calibration.recipes import stage_title
from gelpolight_core.session.validation import WORDS

ItemT = TypeVar("ItemT")


TITLES = "", "Sensor", "Verdict", "Validation", "Name", "Age", "Created"
"""Titles of the columns of :func:`cells_of`: what decides and identifies is visible first."""
SORTED = Verdict.PASS, Verdict.WARN, Verdict.FAIL
"""The verdicts in the order of sorted rows."""


def session_cells(entry: SessionEntry) -> tuple[TableCell, ...]:
    """Return the cells of a session's row."""
    return (
        TableCell(entry.serial),
        TableCell(entry.folder.name, tip=str(entry.folder)),
        TableCell(str(entry.images), key=entry.images),
        _time_cell(entry.changed),
    )


def cells_of(entry: CalibrationEntry, now: datetime, oldest_days: float) -> tuple[TableCell, ...]:
    """Return the cells of a calibration's row."""
    first, nothing = (_in_use(entry), TableCell(entry.serial)), TableCell("")
    if entry.summary is None:
        broken = TableCell("Broken", "broken", "fail", entry.broken, key=3)
        name = TableCell(entry.name, tip=str(entry.path))
        return (*first, broken, nothing, name, nothing, nothing)
    verdict = entry.summary.verdict
    return (
        *first,
        TableCell(verdict.word, verdict.value, verdict.value, key=SORTED.index(verdict)),
        validated_cell(entry),
        TableCell(entry.name, tip=f"{entry.path}\n{entry.summary.identity}"),
        age_cell(entry.age_days(now), oldest_days),
        made_cell(entry),
    )


def made_cell(entry: CalibrationEntry) -> TableCell:
    """Return the local time at which a calibration was made."""
    return TableCell("unknown", key=0.0) if entry.created is None else _time_cell(entry.created)


def _time_cell(time: datetime) -> TableCell:
    return TableCell(f"{time.astimezone():%Y-%m-%d %H:%M}", key=time.timestamp())


def age_cell(age_days: float | None, oldest_days: float) -> TableCell:
    """Return an age as text, marked if it is above the limit."""
    if age_days is None:
        return TableCell("", key=0.0)
    text = "today" if age_days < 1.0 else f"{int(age_days)} d"
    if age_days <= oldest_days:
        return TableCell(text, key=age_days)
    tip = (
        f"Older than {oldest_days:.0f} days. Gel hardens and yellows: validate this calibration, "
        "or calibrate again."
    )
    return TableCell(text, "stale", "stale", tip, key=age_days)


def validated_cell(entry: CalibrationEntry) -> TableCell:
    """Return the validation state of a calibration."""
    trial = entry.validation
    if trial is None:
        return TableCell("not validated", "", "muted", key=len(SORTED))
    verdict, tip = trial.verdict, f"{trial.indenter}, {trial.when}"
    # The title of the column is the first word of some.
    word = WORDS[verdict].lower().removeprefix("validation ")
    sign = "validated" if trial.passed else verdict.value
    return TableCell(word, sign, verdict.value, tip, key=SORTED.index(verdict))


def _in_use(entry: CalibrationEntry) -> TableCell:
    return TableCell("", "use", "accent", "In use", key=1) if entry.in_use else TableCell("", key=0)


class TitledTable(QWidget, Generic[ItemT]):
    """A titled table with a button for the selected row, which a double click presses, too.

    Parameters
    ----------
    name : str
        Object name.
    title : str
        Title of the table.
    columns : tuple of str
        Titles of the columns.
    cells : callable
        Returns the cells of an item.
    path : callable
        Returns the file or folder of an item, which keeps it selected.
    button : (str, str, str)
        Object name, text and tooltip of the button.
    empty : str
        Shown in place of an empty table.
    on_chosen : callable
        Called with the path of the selected item.
    """

    def __init__(
        self,
        name: str,
        title: str,
        columns: tuple[str, ...],
        cells: Callable[[ItemT], tuple[TableCell, ...]],
        path: Callable[[ItemT], Path],
        button: tuple[str, str, str],
        empty: str,
        on_chosen: Callable[[Path], object],
    ) -> None:
        super().__init__()
        set_names(self, name, title)
        self._path, self._on_chosen = path, on_chosen
        self.table = CellsTable(f"{name}.table", title, columns, cells, path)
        self.table.sortByColumn(0, Qt.SortOrder.AscendingOrder)
        self.table.doubleClicked.connect(lambda _: self._choose())
        self.table.selectionModel().selectionChanged.connect(self._enable)
        key, text, tip = button
        self.action = make_action(self, key, text, self._choose, tip=tip)
        self.table.addAction(self.action)
        self._stack = stack_over_text(f"{name}.empty", empty, self.table)
        row = hbox(heading(title), None, action_button(self.action))
        vbox(row, (self._stack, 1), of=self, margins=(0, 8, 0, 0))

    def set_entries(self, entries: tuple[ItemT, ...]) -> None:
        """Show these items. The selection is kept."""
        self.table.show_items(entries)
        self._stack.setCurrentIndex(1 if entries else 0)
        self._enable()

    def _enable(self) -> None:
        self.action.setEnabled(self.table.chosen() is not None)

    def _choose(self) -> None:
        if (item := self.table.chosen()) is not None:
            self._on_chosen(self._path(item))


def sessions_box(on_continue: Callable[[Path], object]) -> TitledTable[SessionEntry]:
    """Return the table of sessions, with a button to continue the selected one."""
    tip = "Open the selected session with all its images and decisions"
    return TitledTable(
        "sensors.sessions",
        "Sessions",
        ("Sensor", "Session", "Images", "Last changed"),
        session_cells,
        lambda session: session.folder,
        ("sensors.go_on", "&Continue calibration", tip),
        "None yet. A calibration that you begin is listed here, with its images.",
        on_continue,
    )


def recordings_box(on_play: Callable[[Path], object]) -> TitledTable[Path]:
    """Return the table of recordings, with a button to play the selected one."""
    return TitledTable(
        "sensors.recordings",
        "Recordings",
        ("Sensor", "Recording", "Size", "Last changed"),
        recording_cells,
        lambda path: path,
        ("sensors.play", "Pla&y", "Use the selected recording as the camera"),
        "None yet. What you record on the Inspect page is listed here.",
        on_play,
    )


def recording_cells(path: Path) -> tuple[TableCell, ...]:
    """Return the cells of a recording's row."""
    stat = path.stat()
    return (
        TableCell(path.parent.parent.name),
        TableCell(path.stem, tip=str(path)),
        TableCell(f"{1e-6 * stat.st_size:.0f} MB", key=stat.st_size),
        _time_cell(datetime.fromtimestamp(stat.st_mtime).astimezone()),
    )


class CalibrationDetails(QWidget):
    """Shows one calibration, or what to do if none is selected.

    Parameters
    ----------
    actions : tuple of QAction
        Actions on the calibration, the main one first. Four are in the first row.
    """

    def __init__(self, actions: tuple[QAction, ...]) -> None:
        super().__init__()
        set_names(self, "sensors.details", "Details of the calibration")
        self._title = set_names(MarkupLabel(parent=self), "sensors.details.title", "Calibration")
        self._facts = set_names(PlainLabel(parent=self), "sensors.details.facts", "Origin")
        for label in (self._title, self._facts):
            label.setWordWrap(True)
            label.setAlignment(Qt.AlignmentFlag.AlignLeft | Qt.AlignmentFlag.AlignTop)
            label.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        # Space for the longest text, that of a validated calibration, so that the buttons do not
        # move.
        self._facts.setMinimumHeight(6 * self._facts.fontMetrics().lineSpacing())
        buttons = [action_button(action, primary=action is actions[0]) for action in actions]
        rows = hbox(*buttons[:4], spacing=8), hbox(*buttons[4:], spacing=8)
        self._area = scroll_area(QWidget())
        set_names(self._area, "sensors.details.stages", "Quality of the stages")
        self.busy = busy_bar("sensors.busy", "Writing the report")
        parts = self._title, self._facts, *rows, self.busy
        self.chart = TimeChart("sensors.over_time", "Errors of this sensor over time")
        self.chart.setToolTip("All calibrations and validations of the sensor. Dashed: tolerances")
        tabs = set_names(QTabWidget(documentMode=True), "sensors.tabs", "Quality and its change")
        tabs.addTab(self._area, "Quality")
        tabs.addTab(self.chart, "Over time")
        vbox(*parts, (tabs, 1), of=self, margins=(12, 0, 0, 0))

    def show_entry(self, entry: CalibrationEntry | None, uses: str = "") -> None:
        """Show a calibration with the number of its uses, or none."""
        if entry is None:
            self._title.setText("")
            self._facts.setText("Select a calibration to see its quality.")
            self._area.setWidget(QWidget())
            return
        self._title.setText(f"<h3>{escaped(entry.name)}</h3>")
        if entry.summary is None:
            self._facts.setText(f"This file cannot be read: {entry.broken}")
        else:
            self._facts.setText(facts(entry, entry.summary, uses))
        stages = _stages(entry)
        self._area.setWidget(stages)
        # It scrolls only up and down: no limit is cut at the right.
        bar = self._area.verticalScrollBar().sizeHint().width()
        self._area.setMinimumWidth(stages.minimumSizeHint().width() + bar)


def _stages(entry: CalibrationEntry) -> QWidget:
    """Return the quality tables of all stages, one below the other."""
    stages = QWidget()
    column = vbox(of=stages, margins=(0, 0, 8, 0))
    for stage, table in (entry.summary.quality if entry.summary is not None else {}).items():
        title = stage_title(stage)
        column.addWidget(_heading(title, table.verdict))
        widget = QualityTableWidget(f"sensors.quality.{stage}", title, narrow=True)
        widget.set_table(table)
        column.addWidget(widget)
    column.addStretch(1)
    return stages


def _heading(title: str, verdict: Verdict) -> QWidget:
    heading = QWidget()
    sign = StatusIcon(icon(verdict.value, verdict.value))
    parts = sign, MarkupLabel(f"<b>{escaped(title)}</b>"), PlainLabel(verdict.word), None
    hbox(*parts, of=heading, margins=(0, 10, 0, 0))
    return heading


def uses_text(count: int, last: datetime | None) -> str:
    """Return how many measurements were saved with a calibration, and when the last was."""
    if last is None:
        return "No measurement was saved with it"
    return f"Measurements saved with it: {count}, the last on {last.astimezone():%Y-%m-%d %H:%M}"


def facts(entry: CalibrationEntry, summary: CalibrationSummary, uses: str) -> str:
    """Return origin, use and validation of a calibration as text."""
    width, height = summary.image_size
    operator = f"by {summary.operator}" if summary.operator else ""
    trial = entry.validation
    none = ["Not validated: choose Validate, and press an object of known size"]
    lines = [
        f"Sensor {summary.serial}, model {summary.model}, images of {width} x {height} px",
        f"Made {made_cell(entry).text} {operator} from session {summary.session}, "
        f"program {summary.program_version}",
        uses,
        summary.accepted and f"Used although it failed: {summary.accepted}",
    ]
    return "\n".join((*filter(None, lines), *(none if trial is None else trial.lines())))
