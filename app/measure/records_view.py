"""The records: table, statistics, error over time, and CSV export."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from operator import attrgetter
from pathlib import Path

from PySide6.QtCore import QLocale, Qt
from PySide6.QtWidgets import QAbstractItemView, QHeaderView, QWidget

from app.program.context import AppContext
from app.program.file_dialogs import ask_save
from app.program.preferences import WarningLimits
from app.widgets.actions import action_button, make_action, undo_actions
from app.widgets.cells_table import CellsTable
from app.widgets.inputs import ComboBox
from app.widgets.label import MarkupLabel, PlainLabel, escaped
from app.widgets.layout import hbox, splitter, vbox
from app.widgets.text_roles import named_label, stack_over_text
from app.widgets.time_chart import DEPTH, PLANE, ChartSeries, TimeChart
from app.widgets.widget_names import set_names
from gelpolight_core.base.compared_quantity import Quantity, unit_behind
from gelpolight_core.lab.measurement_record import FILE, MeasurementRecord
from gelpolight_core.lab.measurement_store import write_csv
from gelpolight_core.measurement.statistics import Statistics, statistics_of, too_few_repeats
from gelpolight_core.measurement.tools.tool_registry import DEPTH_FIGURES

from .record_table import IMAGE, NOTE, TITLES, record_cells, shape_label
from .records_model import RecordsModel

IMAGE_WIDTH = 130


class RecordsView(QWidget):
    """Shows the records of the workspace as a table, as statistics and over time.

    Parameters
    ----------
    book : RecordsModel
        The records.
    on_open : callable
        Called with the file of an image to measure on it again.
    context : AppContext
        Shared by all pages.
    """

    def __init__(
        self, book: RecordsModel, *, on_open: Callable[[Path], object], context: AppContext
    ) -> None:
        super().__init__()
        set_names(self, "measure.results", "Records")
        self._book, self._on_open, self._context = book, on_open, context
        self.sensor = set_names(ComboBox(), "measure.results.sensor", "Sensor")
        self.shape = set_names(ComboBox(), "measure.results.shape", "Object")
        for box in (self.sensor, self.shape):
            box.activated.connect(self._on_filter)
        export, tip = self.choose_export, "Save the selected records, or all that are shown"
        self.export_action = make_action(
            self, "records.export", "Records as CSV…", export, icon_name="copy", tip=tip
        )
        remove, tip, keys = self.remove_selected, "Delete measurements", ("Delete",)
        self.remove = make_action(
            self, "records.delete", "Delete", remove, keys=keys, icon_name="remove", tip=tip
        )
        tip = "Open its image on Measure, to measure again or to write its certificate"
        self.open_action = make_action(
            self, "records.open", "Open image", self._open, icon_name="picture", tip=tip
        )
        self._offer = ""
        undo_actions(self, "records", book.undo, ("Undo in the records", "Redo in the records"))
        self.count = named_label("measure.results.count", "Number of records shown", wrap=False)
        self.message = named_label("measure.results.message", "Last answer", role="muted")
        self.table = self._make_table()
        self.statistics = set_names(
            MarkupLabel(wrap=True), "measure.results.statistics", "Statistics"
        )
        self.statistics.setTextInteractionFlags(Qt.TextInteractionFlag.TextSelectableByMouse)
        self.statistics.setAlignment(Qt.AlignmentFlag.AlignTop | Qt.AlignmentFlag.AlignLeft)
        title = "Error over time"
        self.drift = TimeChart("measure.drift", title)
        self.drift_title = named_label("measure.results.drift_title", title, wrap=False)
        self._lay_out()
        book.changed.connect(self.refresh)
        book.undo.indexChanged.connect(self._close_offer)
        self.refresh()

    def _make_table(self) -> CellsTable[MeasurementRecord]:
        table = CellsTable[MeasurementRecord](
            "measure.results.table",
            "Measurements",
            TITLES,
            record_cells,
            attrgetter("id"),
            editable=NOTE,
        )
        table.edited.connect(self._book.write_note)
        table.doubleClicked.connect(lambda index: self._open(index.column()))
        table.sortByColumn(0, Qt.SortOrder.DescendingOrder)
        table.setSelectionMode(QAbstractItemView.SelectionMode.ExtendedSelection)
        table.verticalHeader().setDefaultSectionSize(26)
        header = table.horizontalHeader()
        header.setStretchLastSection(False)
        header.setSectionResizeMode(NOTE, QHeaderView.ResizeMode.Stretch)
        header.setSectionResizeMode(IMAGE, QHeaderView.ResizeMode.Interactive)
        header.resizeSection(IMAGE, IMAGE_WIDTH)
        table.selectionModel().selectionChanged.connect(lambda *_: self._describe())
        table.addActions([self.open_action, self.export_action, self.remove])
        return table

    def _lay_out(self) -> None:
        right = QWidget()
        vbox(self.drift_title, (self.drift, 1), of=right, margins=(8, 8, 0, 0))
        self.statistics.setMargin(8)
        across, down = Qt.Orientation.Horizontal, Qt.Orientation.Vertical
        below = splitter(across, (self.statistics, 0), (right, 0), sizes=(470, 700))
        split = splitter(down, (self.table, 0), (below, 0), sizes=(420, 260))
        empty = "No records yet. Measure a press and save it to the records."
        self.stack = stack_over_text("measure.results.empty", empty, split)
        filters = PlainLabel("Sensor"), self.sensor, PlainLabel("Object"), self.shape
        buttons = map(action_button, (self.open_action, self.remove, self.export_action))
        bar = hbox(*filters, self.count, (self.message, 1), *buttons, spacing=8)
        vbox(bar, (self.stack, 1), of=self, margins=(16, 8, 16, 8), spacing=8)

    # What is shown

    def refresh(self) -> None:
        """Show the current records. The selection is kept."""
        records = self._book.records
        serials = sorted({(r.serial, r.serial) for r in records})
        shapes = sorted({(r.shape, shape_label(r.shape)) for r in records})
        self.sensor.offer([("All sensors", ""), *serials], self.sensor.currentData())
        objects = [("All objects", ""), *((text, shape) for shape, text in shapes)]
        self.shape.offer(objects, self.shape.currentData())
        self._on_filter()
        self.stack.setCurrentIndex(1 if records else 0)
        self.export_action.setEnabled(bool(records))

    def _on_filter(self) -> None:
        serial, shape = self.sensor.currentData() or "", self.shape.currentData() or ""
        records = self._book.records
        visible = [r for r in records if serial in ("", r.serial) and shape in ("", r.shape)]
        self.table.show_items(visible)
        self.count.setText(f"{len(visible)} of {len(records)}")
        self._describe()

    def group(self) -> tuple[MeasurementRecord, ...]:
        """Return the records for the statistics.

        These are the selected ones if there are several. Otherwise all visible ones with the same
        sensor, shape and true size as the selected one or, if none is selected, as the first row.
        """
        selected, visible = self.table.selected, self.table.shown
        if len(selected) > 1:
            return tuple(r for r in selected if _thing(r)[1] == _thing(selected[0])[1])
        like = (*selected, *visible)[:1]
        return tuple(r for r in visible if _thing(r) == _thing(like[0])) if like else ()

    def _describe(self) -> None:
        group = self.group()
        for action in (self.remove, self.open_action):
            action.setEnabled(bool(self.table.selected))
        self.statistics.setText(_statistics_text(group))
        serial = group[0].serial if group else ""
        records = tuple(r for r in self.table.shown if r.serial == serial)
        self.drift.show_series(errors_over_time(records, self._context.settings.limits))
        title = f"Error of {serial} over time, with the limits"
        self.drift_title.setText(title if serial else "")

    # Actions

    def remove_selected(self) -> None:
        """Remove the selected measurements. Ctrl+Z restores them."""
        numbers = tuple(r.id for r in self.table.selected if r.id is not None)
        self._book.remove(numbers)
        self._offer = f"Measurements removed: {len(numbers)}"
        self._context.toasts.show(self._offer, actions=(("Undo", self._book.undo.undo),))

    def _close_offer(self) -> None:
        """Close the message that offers to undo a removal: another step is the last one now."""
        for toast in self._context.toasts.shown():
            if toast.text == self._offer:
                toast.dismiss()

    def _open(self, column: int = IMAGE) -> None:
        """Measure again on the image of the selected record. A note is edited instead."""
        record = self.table.chosen()
        if record is None or column == NOTE:
            return
        file = str(record.settings.get(FILE, ""))
        if Path(file).is_file():
            self._on_open(Path(file))
        else:
            self.message.setText(f"There is no image file {file or record.picture} to open.")

    def choose_export(self) -> None:
        """Let the user choose the file of the table."""
        settings, sign = self._context.settings, "comma" if has_decimal_comma() else "point"
        title, patterns = "Export as CSV", f"Tables with a decimal {sign} (*.csv)"
        if path := ask_save(self, settings, "table", title, "measurements.csv", patterns):
            self.export_to(path)

    def export_to(self, path: Path) -> None:
        """Write the table of the selected measurements or, if none is selected, of all shown."""
        records = self.table.selected or self.table.shown
        saved = f"{len(records)} measurements saved to {path}"
        self.message.setText("Writing the table")
        self._book.change(
            "Writing the table",
            lambda _store: write_csv(records, path, comma=has_decimal_comma()),
            lambda _: self.message.setText(saved),
        )


def has_decimal_comma() -> bool:
    """Whether the system's spreadsheets read a decimal comma."""
    return QLocale.system().decimalPoint() == ","


def errors_over_time(
    records: tuple[MeasurementRecord, ...], limits: WarningLimits
) -> tuple[ChartSeries, ...]:
    """Return the errors of the measurements that have a true value: in the plane, and in depth.

    Parameters
    ----------
    records : tuple of MeasurementRecord
        Records of one sensor, in any order.
    limits : WarningLimits
        Position of the limit lines.
    """
    points_by_direction: dict[bool, list[tuple[float, float]]] = {False: [], True: []}
    for record in sorted(records, key=lambda r: r.time):
        for quantity in record.quantities:
            if quantity.error_percent is not None:
                in_depth = quantity.name.rpartition("_")[0] in DEPTH_FIGURES
                point = record.time.timestamp(), quantity.error_percent
                points_by_direction[in_depth].append(point)
    plane, depth = (
        tuple(zip(*points, strict=True)) or ((), ()) for points in points_by_direction.values()
    )
    return (
        ChartSeries("in the plane", plane[0], plane[1], limits.size_percent, PLANE, "o"),
        ChartSeries("in depth", depth[0], depth[1], limits.height_percent, DEPTH, "t"),
    )


def _thing(record: MeasurementRecord) -> tuple[str, tuple[object, ...]]:
    """Return the measured object. Measurements of the same object can be compared."""
    truths = tuple(quantity.truth for quantity in record.quantities)
    return record.serial, (record.shape, *truths)


def _statistics_text(group: tuple[MeasurementRecord, ...]) -> str:
    if not group:
        return ""
    first = group[0]
    title = f"{len(group)} x {shape_label(first.shape)}"
    compared = [q for q in first.quantities if q.truth is not None]
    if compared:
        sizes = ", ".join(f"{q.truth:g}{unit_behind(q.unit)}" for q in compared)
        title += f", true {sizes}"
    rows = []
    for quantity in first.quantities[:2]:
        found = [q for record in group if (q := record.quantity(quantity.name)) is not None]
        values = [q.value for q in found]
        errors = [q.error_percent for q in found if q.error_percent is not None]
        rows.append(_row("td", *_cells(quantity, statistics_of(values), errors)))
    heads = "mean", "sd", "spread", "repeatability", "mean error"
    note = "Repeatability: two measurements differ by less than this value in 95 of 100 cases."
    table = f"<table>{_row('th', '', heads)}{''.join(rows)}</table>"
    return f"<b>{escaped(title)}</b><br><br>{table}<br>{note}"


def _cells(quantity: Quantity, found: Statistics, errors: list[float]) -> tuple[str, list[str]]:
    """Return label and figures of a quantity."""
    values = found.mean, found.sd, found.spread
    cells = [f"{value:.4f}" if math.isfinite(value) else "-" for value in values]
    limit = too_few_repeats(found.missing) or f"{found.repeatability:.4f}"
    error = f"{sum(errors) / len(errors):+z.2f} %" if errors else "-"
    return f"{quantity.label} ({unit_behind(quantity.unit).strip()})", [*cells, limit, error]


def _row(tag: str, label: str, cells: Sequence[str]) -> str:
    start = f"<{tag} align='right' style='padding-left: 12px'>"
    row = "".join(f"{start}{cell}</{tag}>" for cell in cells)
    return f"<tr><{tag} align='left'>{escaped(label)}</{tag}>{row}</tr>"
