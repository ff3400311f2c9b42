"""The lab's records: the store of a workspace, with its measurements as a table.

Its files of versions 1 and 2 had a table for each part of a measurement: they are moved over.
"""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterable, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

from gelpolight_core.base.atomic_write import write_atomically
from gelpolight_core.base.compared_quantity import Quantity
from gelpolight_core.base.csv_table import csv_text
from gelpolight_core.base.file_texts import text_of_file
from gelpolight_core.base.safe_reading import parse_json
from gelpolight_core.base.store import Store

from .measurement_record import MeasurementRecord

NAME = "records.sqlite"
_NUMBERS = "value", "sd", "truth", "limit_percent", "truth_sd"
_TEXTS = "serial", "shape", "verdict", "operator", "picture", "note"
_WHICH = "id", "time_utc", "sensor", "calibration", "shape", "quantity"
_VALUES = "value", "sd", "truth", "error", "error_percent", "limit_percent"
_REMARKS = "verdict", "reason", "operator", "picture", "note", "settings"
_REFERENCE = "truth_sd", "en"
COLUMNS = (*_WHICH, *_VALUES, *_REMARKS, *_REFERENCE)


def open_records(path: Path) -> Store:
    """Open or create the records, and move records of earlier versions over.

    Parameters
    ----------
    path : Path
        The file; its folder must exist.

    Raises
    ------
    InputError
        See :class:`~gelpolight_core.base.store.Store`.
    """
    return Store(path, _take_measurements)


def _take_measurements(
    connection: sqlite3.Connection,
) -> list[tuple[MeasurementRecord, str | None]]:
    """Return all measurements, each with the time of its removal, and drop their tables.

    Raises
    ------
    sqlite3.Error
        If a table cannot be read.
    ValueError, TypeError, LookupError
        If a row is not a valid measurement.
    """
    quantities: dict[int, list[Quantity]] = {}
    for part in _rows(connection, "quantities ORDER BY position"):
        numbers: list[Any] = [part.get(name) for name in _NUMBERS]  # version 1 has no truth_sd
        quantities.setdefault(part["measurement_id"], []).append(Quantity(part["name"], *numbers))
    measurements = []
    for row in _rows(connection, "measurements ORDER BY id"):
        record = MeasurementRecord(
            **{name: row[name] for name in _TEXTS},
            reason=text_of_file(row["reason"]),
            calibration_id=row["calibration_id"] or "",
            quantities=tuple(quantities[row["id"]]),
            settings=parse_json(row["settings"]),
            details=parse_json(row["details"]),
            time=datetime.fromisoformat(row["time"]),
            id=row["id"],
        )
        measurements.append((record, row["removed"]))
    for table in ("quantities", "measurements", "calibrations", "sensors"):
        connection.execute(f"DROP TABLE {table}")
    return measurements


def _rows(connection: sqlite3.Connection, table: str) -> list[dict[str, Any]]:
    cursor = connection.execute(f"SELECT * FROM {table}")
    names = [column[0] for column in cursor.description]
    return [dict(zip(names, row, strict=True)) for row in cursor]


def rows_of(records: Iterable[MeasurementRecord]) -> list[tuple[object, ...]]:
    """Return the lines of the table, under :data:`COLUMNS`, with None for unknown values."""
    rows = list[tuple[object, ...]]()
    for r in records:
        time = r.time.strftime("%Y-%m-%d %H:%M:%S")
        settings = json.dumps(dict(r.settings), ensure_ascii=False) if r.settings else ""
        remarks = map(_safe, (r.verdict, r.reason, r.operator, r.picture, r.note))
        last = (*remarks, settings)
        for q in r.quantities:
            which = map(_safe, (r.serial, r.calibration_id, r.shape, q.name))
            numbers = (getattr(q, name) for name in _VALUES)
            reference = (getattr(q, name) for name in _REFERENCE)
            rows.append((r.id, time, *which, *numbers, *last, *reference))
    return rows


def _safe(text: str) -> str:
    """Return a text that no spreadsheet interprets as a formula."""
    return f"'{text}" if text.startswith(("=", "+", "-", "@", "\t", "\r")) else text


def write_csv(records: Sequence[MeasurementRecord], path: Path, *, comma: bool = False) -> None:
    """Write the table, completely or not at all, for spreadsheets with a decimal comma or point.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    # The byte order mark tells spreadsheets that the file is UTF-8.
    text = csv_text(COLUMNS, rows_of(records), comma=comma).encode("utf-8-sig")
    write_atomically(path, lambda stream: stream.write(text))
