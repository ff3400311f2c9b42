"""Convert measurements to table rows and back."""

from __future__ import annotations

import json
import sqlite3
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from pathlib import Path

from gelpolight_core.io.atomic import write_atomically
from gelpolight_core.io.reading import parse_json, written_text
from gelpolight_core.io.table import csv_text
from gelpolight_core.io.texts import text_of_file
from gelpolight_core.quantity import Quantity
from gelpolight_core.records.database import VALUE_LIMIT
from gelpolight_core.records.entry import MeasurementRecord


def text_of(time: datetime) -> str:
    """Return a time as text that sorts in the order of time."""
    return time.astimezone(UTC).isoformat(timespec="microseconds")


def row_of(record: MeasurementRecord) -> tuple[str | None, ...]:
    """Return a measurement as a row, from its time to its note."""
    return (
        text_of(record.time),
        record.serial,
        record.calibration_id or None,
        record.shape,
        record.verdict,
        record.reason,
        json.dumps(dict(record.settings), allow_nan=False),
        json.dumps(dict(record.details), allow_nan=False),
        record.operator,
        record.picture,
        record.note,
    )


def quantity_rows(record: MeasurementRecord) -> list[tuple[object, ...]]:
    """Return the measured values as rows, without the measurement's number."""
    return [
        (k, q.name, q.value, q.sd, q.truth, q.error, q.error_percent, q.limit_percent, q.truth_sd)
        for k, q in enumerate(record.quantities)
    ]


def records_of(
    rows: Sequence[sqlite3.Row], parts: Sequence[sqlite3.Row]
) -> tuple[MeasurementRecord, ...]:
    """Build measurements from their rows and those of their values.

    Raises
    ------
    ValueError, TypeError, KeyError
        If a row is not a valid measurement.
    """
    quantities: dict[int, list[Quantity]] = {}
    for part in parts:
        quantities.setdefault(part["measurement_id"], []).append(_quantity(part))
    return tuple(_record(row, tuple(quantities.get(row["id"], ()))) for row in rows)


def _quantity(row: sqlite3.Row) -> Quantity:
    numbers = (row["value"], row["sd"], row["truth"], row["limit_percent"], row["truth_sd"])
    return Quantity(written_text(row["name"]), *numbers)


_TEXTS = ("serial", "shape", "verdict", "operator", "picture", "note")


def _record(row: sqlite3.Row, quantities: tuple[Quantity, ...]) -> MeasurementRecord:
    settings, details = parse_json(row["settings"]), parse_json(row["details"])
    if not isinstance(settings, dict) or not isinstance(details, dict):
        raise ValueError("the settings of a measurement are not a table")
    texts = {name: written_text(row[name], VALUE_LIMIT) for name in _TEXTS}
    return MeasurementRecord(
        **texts,
        reason=text_of_file(written_text(row["reason"], VALUE_LIMIT)),
        calibration_id=written_text(row["calibration_id"] or ""),
        quantities=quantities,
        settings=settings,
        details=details,
        time=datetime.fromisoformat(row["time"]),
        id=row["id"],
    )


_WHICH = "id", "time_utc", "sensor", "calibration", "shape", "quantity"
_NUMBERS = "value", "sd", "truth", "error", "error_percent", "limit_percent"
_REMARKS = "verdict", "reason", "operator", "picture", "note", "settings"
_REFERENCE = "truth_sd", "en"
COLUMNS = (*_WHICH, *_NUMBERS, *_REMARKS, *_REFERENCE)


def rows_of(records: Iterable[MeasurementRecord]) -> list[tuple[object, ...]]:
    """Return the lines of the table, under :data:`COLUMNS`; None for unknown values."""
    rows = list[tuple[object, ...]]()
    for r in records:
        time = r.time.strftime("%Y-%m-%d %H:%M:%S")
        settings = json.dumps(dict(r.settings), ensure_ascii=False) if r.settings else ""
        remarks = map(_safe, (r.verdict, r.reason, r.operator, r.picture, r.note))
        last = (*remarks, settings)
        for q in r.quantities:
            which = map(_safe, (r.serial, r.calibration_id, r.shape, q.name))
            numbers = (getattr(q, name) for name in _NUMBERS)
            reference = (getattr(q, name) for name in _REFERENCE)
            rows.append((r.id, time, *which, *numbers, *last, *reference))
    return rows


def _safe(text: str) -> str:
    """Return a text that no spreadsheet interprets as a formula."""
    return f"'{text}" if text.startswith(("=", "+", "-", "@", "\t", "\r")) else text


def write_csv(records: Sequence[MeasurementRecord], path: Path) -> None:
    """Write the table, completely or not at all.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    # The byte order mark tells spreadsheets that the file is UTF-8.
    text = csv_text(COLUMNS, rows_of(records)).encode("utf-8-sig")
    write_atomically(path, lambda stream: stream.write(text))
