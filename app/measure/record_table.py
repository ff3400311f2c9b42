"""The records as a table: one row per measurement, sortable and filterable."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from PySide6.QtCore import (
    QAbstractTableModel,
    QModelIndex,
    QPersistentModelIndex,
    QSortFilterProxyModel,
    Qt,
    Signal,
)

from app.measure.figures_text import unit_behind, unit_of, value_text
from app.measure.placing import kind_label
from app.theme import theme
from app.theme.icons import icon
from app.widgets.label import plain_tip
from gelpolight_core.records.entry import DOUBTFUL, FAILED, PASSED, MeasurementRecord, Quantity
from gelpolight_core.records.evaluation_entry import SHAPE as EVALUATION
from gelpolight_core.translation import tr

Index = QModelIndex | QPersistentModelIndex
NOWHERE = QModelIndex()
SORT = Qt.ItemDataRole.UserRole
TIME, SENSOR, WHAT, FIRST, FIRST_ERROR, DEPTH, DEPTH_ERROR, VERDICT, OPERATOR, NOTE, IMAGE = range(
    11
)
_RIGHT = (FIRST, FIRST_ERROR, DEPTH, DEPTH_ERROR)
_VERDICTS = {PASSED: ("pass", "pass"), FAILED: ("fail", "fail"), DOUBTFUL: ("warn", "warn")}


def verdict_word(verdict: str) -> str:
    """Return the text of a verdict."""
    words = {PASSED: tr("within limit"), FAILED: tr("outside limit"), DOUBTFUL: tr("doubtful")}
    return words.get(verdict, tr("no true value"))


def shape_label(shape: str) -> str:
    """Return the name of the measured object or figure."""
    if shape == EVALUATION:
        return tr("Evaluation (mean errors)")
    return kind_label(shape.replace("_", "-"))


def quantity_text(quantity: Quantity | None) -> str:
    """Return a value as text. Empty if there is none."""
    if quantity is None:
        return ""
    return value_text(quantity.value, quantity.sd, unit_of(quantity.name))


def error_text(quantity: Quantity | None) -> str:
    """Return an error in its unit and in percent. Empty if there is no true value."""
    if quantity is None or quantity.error is None or quantity.error_percent is None:
        return ""
    behind = unit_behind(unit_of(quantity.name))
    return f"{quantity.error:+.3f}{behind}, {quantity.error_percent:+.2f} %"


class RecordModel(QAbstractTableModel):
    """All records.

    Signals
    -------
    note_written(int, str)
        A note was typed: the measurement's number and the note.
    """

    note_written = Signal(int, str)

    def __init__(self) -> None:
        super().__init__()
        self.records: tuple[MeasurementRecord, ...] = ()

    def show(self, records: tuple[MeasurementRecord, ...]) -> None:
        """Show other records."""
        self.beginResetModel()
        self.records = records
        self.endResetModel()

    def rowCount(self, parent: Index = NOWHERE) -> int:  # noqa: D102
        return 0 if parent.isValid() else len(self.records)

    def columnCount(self, parent: Index = NOWHERE) -> int:  # noqa: D102
        return 0 if parent.isValid() else len(_COLUMNS)

    def headerData(  # noqa: D102
        self, section: int, orientation: Qt.Orientation, role: int = Qt.ItemDataRole.DisplayRole
    ) -> Any:
        if role == Qt.ItemDataRole.DisplayRole and orientation == Qt.Orientation.Horizontal:
            return _COLUMNS[section][0]
        return None

    def flags(self, index: Index) -> Qt.ItemFlag:  # noqa: D102
        usual = super().flags(index)
        return usual | Qt.ItemFlag.ItemIsEditable if index.column() == NOTE else usual

    def setData(  # noqa: D102
        self, index: Index, value: Any, role: int = Qt.ItemDataRole.EditRole
    ) -> bool:
        number = self.records[index.row()].id
        if index.column() != NOTE or role != Qt.ItemDataRole.EditRole or number is None:
            return False
        self.note_written.emit(number, str(value))
        return True

    def data(self, index: Index, role: int = Qt.ItemDataRole.DisplayRole) -> Any:  # noqa: D102
        record, column = self.records[index.row()], index.column()
        if role in (Qt.ItemDataRole.DisplayRole, Qt.ItemDataRole.EditRole):
            return _COLUMNS[column][1](record)
        if role == SORT:
            return _sort_value(record, column)
        if role == Qt.ItemDataRole.TextAlignmentRole and column in _RIGHT:
            return int(Qt.AlignmentFlag.AlignRight | Qt.AlignmentFlag.AlignVCenter)
        if role == Qt.ItemDataRole.DecorationRole and column == WHAT:
            if record.shape == EVALUATION:
                return icon("report")
            return icon(f"tool-{record.shape.replace('_', '-')}")
        if role == Qt.ItemDataRole.DecorationRole and column == VERDICT:
            found = _VERDICTS.get(record.verdict)
            return None if found is None else icon(*found)
        if role == Qt.ItemDataRole.ForegroundRole and column in (FIRST_ERROR, DEPTH_ERROR):
            quantity = _quantity(record, column)
            passed = None if quantity is None else quantity.passed
            return None if passed is None else theme.colour("pass" if passed else "fail")
        if role == Qt.ItemDataRole.ToolTipRole:
            return plain_tip(_tip(record))
        return None


class RecordFilter(QSortFilterProxyModel):
    """Shows the records of one sensor and object type, or all."""

    def __init__(self, model: RecordModel) -> None:
        super().__init__()
        self._model = model
        self.serial, self.shape = "", ""
        self.setSourceModel(model)
        self.setSortRole(SORT)

    def choose(self, serial: str, shape: str) -> None:
        """Show the records of this sensor and shape. Empty: of all."""
        self.beginFilterChange()
        self.serial, self.shape = serial, shape
        self.endFilterChange()

    def filterAcceptsRow(self, row: int, parent: Index) -> bool:  # noqa: D102
        record = self._model.records[row]
        return self.serial in ("", record.serial) and self.shape in ("", record.shape)

    @property
    def shown(self) -> tuple[MeasurementRecord, ...]:
        """The visible records, in the order of the table."""
        rows = range(self.rowCount())
        return tuple(
            self._model.records[self.mapToSource(self.index(row, 0)).row()] for row in rows
        )


def _depth(record: MeasurementRecord) -> Quantity | None:
    return record.quantity("height_mm") or record.quantity("depth_error_percent")


def _quantity(record: MeasurementRecord, column: int) -> Quantity | None:
    return record.quantities[0] if column in (FIRST, FIRST_ERROR) else _depth(record)


_COLUMNS: tuple[tuple[str, Callable[[MeasurementRecord], str]], ...] = (
    (tr("Date"), lambda record: record.time.astimezone().strftime("%Y-%m-%d %H:%M")),
    (tr("Sensor"), lambda record: record.serial),
    (tr("Object"), lambda record: shape_label(record.shape)),
    (tr("Size or figure"), lambda record: quantity_text(record.quantities[0])),
    (tr("Error"), lambda record: error_text(record.quantities[0])),
    (tr("Depth"), lambda record: quantity_text(_depth(record))),
    (tr("Error"), lambda record: error_text(_depth(record))),
    (tr("Verdict"), lambda record: verdict_word(record.verdict)),
    (tr("Operator"), lambda record: record.operator),
    (tr("Note"), lambda record: record.note),
    (tr("Image"), lambda record: record.picture),
)
"""Header of each column, and its text."""


def _sort_value(record: MeasurementRecord, column: int) -> Any:
    if column == TIME:
        return record.time.timestamp()
    if column not in _RIGHT:
        return _COLUMNS[column][1](record)
    quantity = _quantity(record, column)
    value = None
    if quantity is not None:
        value = quantity.value if column in (FIRST, DEPTH) else quantity.error_percent
    return -1e9 if value is None else value


def _tip(record: MeasurementRecord) -> str:
    lines = [f"{quantity.name}: {quantity_text(quantity)}" for quantity in record.quantities]
    lines.append(tr("calibration {identity}").format(identity=record.calibration_id))
    if record.reason:
        lines.append(tr("doubtful: {reason}").format(reason=record.reason))
    return "\n".join(lines)
