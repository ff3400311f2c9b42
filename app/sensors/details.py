"""The selected calibration: origin, quality of all stages, and actions."""

from __future__ import annotations

from datetime import datetime

from PySide6.QtCore import Qt, QUrl
from PySide6.QtGui import QAction, QDesktopServices
from PySide6.QtWidgets import QTabWidget, QWidget

from app.program.calibration_entries import CalibrationEntry
from app.widgets.actions import action_button
from app.widgets.icons import icon
from app.widgets.label import MarkupLabel, PlainLabel, escaped
from app.widgets.layout import hbox, scroll_area, vbox
from app.widgets.quality_table import QualityTableWidget
from app.widgets.status_icon import StatusIcon, busy_bar
from app.widgets.time_chart import TimeChart
from app.widgets.widget_names import set_names
from gelpolight_core.base.finding import Verdict
from gelpolight_core.calibration.manifest import CalibrationSummary
from gelpolight_core.calibration.recipes import stage_title

from .tables import made_cell


class CalibrationDetails(QWidget):
    """Shows one calibration, or what to do if none is selected.

    Parameters
    ----------
    actions : tuple of QAction
        Actions on the calibration, the main one first.
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
        first, *others = actions
        buttons = hbox(action_button(first, primary=True), spacing=8)
        for action in others:
            buttons.addWidget(action_button(action))
        self._area = scroll_area(QWidget())
        set_names(self._area, "sensors.details.stages", "Quality of the stages")
        self.busy = busy_bar("sensors.busy", "Writing the report")
        self._message = set_names(MarkupLabel(wrap=True), "sensors.message", "Last answer")
        self._message.linkActivated.connect(
            lambda path: QDesktopServices.openUrl(QUrl.fromLocalFile(path))
        )
        parts = self._title, self._facts, buttons, self._message, self.busy
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

    def show_message(self, text: str, path: str = "") -> None:
        """Show an answer of the program, with a link to a file that was written."""
        link = f" <a href='{escaped(path)}'>Open</a>" if path else ""
        role = "pass" if path else "fail"
        self._message.setText(f"<span style='color:@{role}'>{escaped(text)}</span>{link}")


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
    sign, text = (
        StatusIcon(icon(verdict.value, verdict.value)),
        MarkupLabel(f"<b>{escaped(title)}</b>"),
    )
    parts = sign, text, PlainLabel(verdict.word), None
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
    none = ["Not validated: press an object of known size to validate it"]
    lines = [
        f"Sensor {summary.serial}, model {summary.model}, images of {width} x {height} px",
        f"Made {made_cell(entry).text} {operator} from session {summary.session}, "
        f"program {summary.program_version}",
        uses,
        summary.accepted and f"Used although it failed: {summary.accepted}",
    ]
    return "\n".join((*filter(None, lines), *(none if trial is None else trial.lines())))
