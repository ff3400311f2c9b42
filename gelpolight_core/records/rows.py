"""Measurements as a table."""

from __future__ import annotations

import json
from collections.abc import Iterable, Sequence
from pathlib import Path

from gelpolight_core.io.atomic import write_atomically
from gelpolight_core.io.table import csv_text
from gelpolight_core.records.entry import MeasurementRecord

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
