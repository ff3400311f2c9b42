"""The Sensors page: the library on the left, the selected calibration on the right."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from datetime import UTC, datetime
from functools import partial
from operator import attrgetter
from pathlib import Path

from PySide6.QtCore import QFile, Qt, QUrl
from PySide6.QtGui import QAction, QDesktopServices
from PySide6.QtWidgets import QAbstractItemView, QWidget

from app.program.calibration_entries import ENDING, CalibrationEntry
from app.program.calibration_status import put_into_use
from app.program.context import AppContext
from app.program.file_dialogs import ask_save, ask_several
from app.program.jobs import BackgroundJob, JobQueue
from app.program.preferences import WarningLimits
from app.program.workspace import copy_file
from app.widgets.actions import action_button, make_action
from app.widgets.cells_table import CellsTable, TableCell
from app.widgets.dialog import ask
from app.widgets.layout import hbox, splitter, vbox
from app.widgets.text_roles import stack_over_text
from app.widgets.time_chart import DEPTH, PLANE, ChartSeries
from app.widgets.widget_names import set_names
from gelpolight_core.base.atomic_write import make_folder
from gelpolight_core.base.errors import InputError
from gelpolight_core.base.finding import join_quality_tables
from gelpolight_core.base.safe_reading import parse_time
from gelpolight_core.session.validation import Validation

from .details import TITLES, CalibrationDetails, cells_of, recordings_box, sessions_box, uses_text

BALLS = ("#3d7a1f", "#9bd070")
"""Colour of ball presses, in the light and the dark theme."""
OF_BALLS = "ball_height_error_percent", "held_out_diameter_percent"
"""Error of the ball presses of an open and of a closed sensor's calibration."""

TrendPoints = dict[datetime, float]


def checks_over_time(
    entries: Iterable[CalibrationEntry], limits: WarningLimits
) -> tuple[ChartSeries, ...]:
    """Return the errors of a sensor over time: validations, and balls of the calibrations.

    Parameters
    ----------
    entries : iterable of CalibrationEntry
        All calibrations of one sensor.
    limits : WarningLimits
        Tolerances of a validation. That of the balls is in the calibration.
    """
    sizes, heights, balls = TrendPoints(), TrendPoints(), TrendPoints()
    balls_limit = 0.0
    for entry in entries:
        if entry.validation is not None:
            _add_validation(entry.validation, sizes, heights)
        quality = {} if entry.summary is None else entry.summary.quality
        for figure in join_quality_tables(quality.values()).figures:
            if figure.key in OF_BALLS and entry.created is not None:
                balls[entry.created] = figure.value
                balls_limit = figure.warn_limit or 0.0
    all_series = (
        _series("Validation: size", sizes, limits.size_percent, PLANE, "o"),
        _series("Validation: height", heights, limits.height_percent, DEPTH, "t"),
        _series("Calibration: balls", balls, balls_limit, BALLS, "s"),
    )
    return tuple(series for series in all_series if series.values)


def _add_validation(validation: Validation, sizes: TrendPoints, heights: TrendPoints) -> None:
    """Add the largest error of a height, and of a size."""
    when = parse_time(validation.when)
    if when is None:
        return
    for points, is_height in ((heights, True), (sizes, False)):
        compared = (c for c in validation.comparisons if (c.name == "height") is is_height)
        if errors := [c.error_percent for c in compared if c.error_percent is not None]:
            points[when] = max(errors, key=abs)


def _series(
    name: str, points: TrendPoints, limit: float, colours: tuple[str, str], sign: str
) -> ChartSeries:
    times = sorted(points)
    seconds = [time.timestamp() for time in times]
    return ChartSeries(name, seconds, [points[time] for time in times], limit, colours, sign)


NAME = TITLES.index("Name")
KEYS = {"use": ("Ctrl+U",), "rename": ("F2",), "remove": ("Del",)}
TIPS = {
    "new": "Calibrate a sensor from its camera",
    "session": "Calibrate from existing images",
    "import": "Copy calibration files into the library",
    "demo": "Use all functions without a camera",
    "use": "Use this calibration for measuring",
    "validate": "Compare measured sizes of known objects with their true sizes",
    "report": "Write a report of this calibration as PDF",
    "copy": "Save this calibration, with its validation, for another computer",
    "rename": "Change the name of this calibration: its content stays",
    "remove": "Move this calibration to the trash of the system",
}
PATTERNS = f"Calibrations (*{ENDING})"
NO_SENSOR = (
    "No sensor yet. Calibrate a sensor, or drop a session folder or a calibration file onto this "
    "window."
)
MEASURE_FIRST = (
    "Its session is not here, and no saved measurement counts{why}. On the Measure page, measure "
    "new presses, state the true sizes, and save each measurement. Then choose Validate again."
)
"""Validation without session and measurements, with why those that are saved do not count."""


class SensorsPage(QWidget):
    """Sensors and their calibrations."""

    def __init__(self, *, context: AppContext) -> None:
        super().__init__()
        self._context = context
        self._entries: tuple[CalibrationEntry, ...] = ()
        set_names(self, "sensors", "Sensors")
        self.offered = self._make_actions()
        actions = tuple(self.offered.values())
        self._table = CellsTable(
            "sensors.table", "Calibrations", TITLES, self._cells, attrgetter("path"), editable=NAME
        )
        self._table.setEditTriggers(QAbstractItemView.EditTrigger.NoEditTriggers)
        # Later: the list is shown again only after the editor has closed.
        self._table.edited.connect(self._rename, Qt.ConnectionType.QueuedConnection)
        self._table.addActions(actions[4:])
        self._table.sortByColumn(1, Qt.SortOrder.AscendingOrder)
        self._table.selectionModel().selectionChanged.connect(self._show_chosen)
        self._table.doubleClicked.connect(lambda _: self.offered["use"].trigger())
        self._sessions = sessions_box(lambda folder: context.requests.session.emit(str(folder)))
        self._recordings = recordings_box(self._play)
        self._reports = JobQueue("report", self)
        self._details = CalibrationDetails(actions[4:])
        self._reports.refused.connect(partial(context.toasts.show, verdict="fail"))
        self._reports.progressed.connect(lambda *_: self._show_chosen())
        lists = splitter(
            Qt.Orientation.Vertical, (self._table, 3), (self._sessions, 2), (self._recordings, 2)
        )
        parts = (lists, 3), (self._details, 2)
        split = splitter(Qt.Orientation.Horizontal, *parts, sizes=(600, 400))
        self._stack = stack_over_text("sensors.empty", NO_SENSOR, split)
        bar = hbox(*map(action_button, actions[:4]), None, spacing=8)
        vbox(bar, (self._stack, 1), of=self, margins=(16, 12, 16, 12), spacing=8)
        context.requests.calibrations_changed.connect(self.refresh)
        self.refresh()

    def _make_actions(self) -> dict[str, QAction]:
        begin, for_chosen = self._context.requests.begin.emit, self._with_chosen
        actions = {}
        for name, sign, text, slot in (
            ("new", "add", "&New sensor", partial(begin, "sensor")),
            ("session", "folder", "Open &session folder", partial(begin, "session")),
            ("import", "import", "&Import calibration", self.choose_calibrations),
            ("demo", "demo", "&Try the virtual sensor", partial(begin, "demo")),
            ("use", "use", "&Use", partial(for_chosen, self._use)),
            ("validate", "validated", "Va&lidate…", partial(for_chosen, self._validate)),
            ("report", "report", "Re&port…", partial(for_chosen, self._choose_report)),
            ("rename", "", "Rena&me", self._edit_name),
            ("copy", "copy", "S&ave a copy…", partial(for_chosen, self._save_copy)),
            ("reveal", "folder", "Show in fol&der", partial(for_chosen, _open_folder)),
            ("remove", "remove", "&Remove", partial(for_chosen, self._ask_to_remove)),
        ):
            keys, tip = KEYS.get(name, ()), TIPS.get(name, "")
            actions[name] = make_action(
                self, f"sensors.{name}", text, slot, keys=keys, icon_name=sign, tip=tip
            )
        return actions

    def export_actions(self) -> tuple[QAction, ...]:
        """Return what the File menu offers to export from this page."""
        return (self.offered["report"],)

    def enter(self) -> None:
        """Read the folder again: files may have been added by other programs."""
        self.refresh()

    def open_path(self, path: Path) -> None:
        """Import a calibration file and select it."""
        self._import((path,))

    def _import(self, files: tuple[Path, ...]) -> None:
        """Copy calibration files into the library, and select the last one."""
        imported = None
        for file in files:
            with self._context.toasts.errors():
                imported = self._context.workspace.import_calibration(file)
                text = f"{imported.name} is now in the library of sensor {imported.parent.name}."
                self._context.toasts.show(text)
        if imported is not None:
            self._context.requests.calibrations_changed.emit()
            self._table.choose(imported)

    def choose_calibrations(self) -> None:
        """Let the user choose files to import."""
        settings, title = self._context.settings, "Import calibrations"
        self._import(ask_several(self, settings, "calibration", title, PATTERNS))

    def _choose_report(self, entry: CalibrationEntry) -> None:
        settings, name = self._context.settings, f"{entry.path.stem}-report.pdf"
        if path := ask_save(self, settings, "report", "Save the report", name, "PDF (*.pdf)"):
            self._write_report(entry, path)

    def _write_report(self, entry: CalibrationEntry, path: Path) -> None:
        name = self._context.display.value.colours

        def work(_progress: object) -> None:
            from app.views.map.colour_tables import colour_table  # slow imports
            from gelpolight_core.calibration.calibration_file import read_calibration
            from gelpolight_core.output.report.calibration_report import calibration_report
            from gelpolight_core.output.report.report_pdf_file import write_report

            calibration = read_calibration(entry.path)
            report = calibration_report(calibration, colours=colour_table(name))
            write_report(report, path)

        def done(_nothing: None) -> None:
            opens = "Open", partial(_open, path)
            self._context.toasts.show(f"Report saved to {path}.", actions=(opens,))

        self._reports.submit(BackgroundJob("Writing the report", work, done, must=True))

    def can_close(self) -> bool:
        """Wait a short time for a file that is being written."""
        self._reports.close()
        return True

    def chosen(self) -> CalibrationEntry | None:
        """Return the selected calibration."""
        return self._table.chosen()

    def _cells(self, entry: CalibrationEntry) -> tuple[TableCell, ...]:
        return cells_of(entry, datetime.now(UTC), self._context.settings.limits.age_days)

    def refresh(self) -> None:
        """Show the present content of the workspace. The selection is kept."""
        workspace, read_list = self._context.workspace, self._context.toasts.read_list
        self._entries, recordings = read_list(workspace.entries), read_list(workspace.recordings)
        recent = self._context.settings.recent("sessions")
        self._all_sessions = sessions = read_list(partial(workspace.sessions, recent))
        self._table.show_items(self._entries)
        self._sessions.set_entries(sessions)
        self._recordings.set_entries(recordings)
        self._stack.setCurrentIndex(1 if self._entries or sessions or recordings else 0)
        if self.chosen() is None and self._entries:
            used = next((entry for entry in self._entries if entry.in_use), self._entries[0])
            self._table.choose(used.path)
        self._show_chosen()

    def _show_chosen(self) -> None:
        entry = self.chosen()
        self._details.busy.setVisible(self._reports.busy)
        self._details.show_entry(entry, self._uses(entry))
        serial = None if entry is None else entry.serial
        entries = [other for other in self._entries if other.serial == serial]
        checks = checks_over_time(entries, self._context.settings.limits)
        self._details.chart.show_series(checks)
        good = entry is not None and not entry.broken
        self.offered["use"].setEnabled(good and entry is not None and not entry.in_use)
        self.offered["validate"].setEnabled(good)
        self.offered["report"].setEnabled(good and not self._reports.busy)
        for name in ("copy", "reveal", "rename", "remove"):
            self.offered[name].setEnabled(entry is not None)

    def _play(self, recording: Path) -> None:
        self._context.source.choose_recording(recording)
        self._context.requests.page.emit("inspect")

    def _uses(self, entry: CalibrationEntry | None) -> str:
        """Return how often a calibration was used, or why that is not known."""
        if entry is None or entry.summary is None:
            return ""
        try:
            return uses_text(*self._context.workspace.uses(entry.summary.identity))
        except InputError as error:
            return str(error)

    def _use(self, entry: CalibrationEntry) -> None:
        put_into_use(entry.path, self, context=self._context)

    def _validate(self, entry: CalibrationEntry) -> None:
        """Open the Validation step of its session or, without that, offer saved measurements."""
        context, summary = self._context, entry.summary
        assert summary is not None, "the action is only for those that can be read"
        of_it = entry.serial, summary.session
        if folders := [s.folder for s in self._all_sessions if (s.serial, s.folder.name) == of_it]:
            context.workspace.to_validate = entry.path
            context.requests.session.emit(str(folders[0]))
            return
        from gelpolight_core.lab.validation_trial import recorded_validation  # slow import

        measure = "&Measure", partial(self._measure, entry)
        with context.toasts.errors():
            limits = context.settings.limits.percent
            trial, why = recorded_validation(context.workspace.records, summary, limits)
            if trial is None:
                why = f" ({why})" if why else ""
                ask(self, "Validate", MEASURE_FIRST.format(why=why), measure)
            else:
                record = "&Record this validation", partial(self._record, trial, entry.path)
                ask(self, "Validate", "\n".join(trial.lines()), record, measure)

    def _record(self, trial: Validation, path: Path) -> None:
        from gelpolight_core.calibration.annotations import write_validation  # slow import

        with self._context.toasts.errors():
            write_validation(trial, path)
        self._context.requests.calibrations_changed.emit()

    def _measure(self, entry: CalibrationEntry) -> None:
        self._use(entry)
        self._context.requests.page.emit("measure")

    def _save_copy(self, entry: CalibrationEntry) -> None:
        settings, name = self._context.settings, entry.path.name
        if path := ask_save(self, settings, "calibration", "Save a copy", name, PATTERNS):
            with self._context.toasts.errors():
                copy_file(entry.path, path)

    def _edit_name(self) -> None:
        for index in self._table.selectionModel().selectedRows(NAME):
            self._table.edit(index)

    def _rename(self, entry: CalibrationEntry, name: str) -> None:
        with self._context.toasts.errors():
            renamed = self._context.workspace.rename(entry.path, name)
            self._context.requests.calibrations_changed.emit()
            self._table.choose(renamed)

    def _ask_to_remove(self, entry: CalibrationEntry) -> None:
        text = f"Move {entry.path.name} to the trash of the system?"
        if entry.in_use:
            text += " It is the calibration in use."
        if entry.validated:
            text += " It is validated."
        answer = "Move to trash", partial(self._remove, entry)
        ask(self, "Remove calibration", text, answer).prefer_cancel()

    def _remove(self, entry: CalibrationEntry) -> None:
        toasts = self._context.toasts
        with toasts.errors():
            self._context.workspace.remove(entry.path, lambda p: bool(QFile.moveToTrash(str(p))))
            toasts.show(f"{entry.path.name} is in the trash of the system.")
        self._context.requests.calibrations_changed.emit()

    def _with_chosen(self, function: Callable[[CalibrationEntry], None]) -> None:
        if (entry := self.chosen()) is not None:
            function(entry)


def _open_folder(entry: CalibrationEntry) -> None:
    make_folder(entry.path.parent)
    _open(entry.path.parent)


def _open(path: Path) -> None:
    QDesktopServices.openUrl(QUrl.fromLocalFile(str(path)))
