"""The records as a table for a spreadsheet: one line per measured value."""

from __future__ import annotations

import csv
import io
import json
from collections.abc import Iterable, Sequence
from pathlib import Path

from gelpolight_core.io.atomic import write_atomically
from gelpolight_core.records.entry import MeasurementRecord

COLUMNS = (
    "id", "time_utc", "sensor", "calibration", "shape", "quantity", "value", "sd", "truth",
    "error", "error_percent", "limit_percent", "verdict", "reason", "operator", "picture", "note",
    "settings",
)  # fmt: skip


def rows_of(records: Iterable[MeasurementRecord]) -> list[tuple[object, ...]]:
    """Return the lines of the table, under :data:`COLUMNS`; None for unknown values."""
    return [
        (
            r.id, r.time.strftime("%Y-%m-%d %H:%M:%S"), _safe(r.serial), _safe(r.calibration_id),
            _safe(r.shape), _safe(q.name),
            q.value, q.sd, q.truth, q.error, q.error_percent, q.limit_percent,
            _safe(r.verdict), _safe(r.reason), _safe(r.operator), _safe(r.picture), _safe(r.note),
            json.dumps(dict(r.settings), ensure_ascii=False) if r.settings else "",
        )
        for r in records
        for q in r.quantities
    ]  # fmt: skip


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
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(COLUMNS)
    writer.writerows(rows_of(records))
    # The byte order mark tells spreadsheets that the file is UTF-8.
    write_atomically(path, lambda stream: stream.write(text.getvalue().encode("utf-8-sig")))
