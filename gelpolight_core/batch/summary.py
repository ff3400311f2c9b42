"""The table of a run: one row per frame, created only from the ledger."""

from __future__ import annotations

import csv
import io
from pathlib import Path
from typing import BinaryIO

from gelpolight_core.batch.ledger import BatchLedger, FrameRow
from gelpolight_core.io.atomic import write_atomically

FILE = "batch.csv"
COLUMNS = (
    "output",
    "input",
    "frame",
    "number",
    "time_s",
    "max_depth_mm",
    "volume_mm3",
    "flagged_share",
    "notes",
    "seconds",
    "error",
)
MEASURED = ("shape", "diameter_mm", "side_mm", "height_mm", "centre_mm", "yaw_deg", "verdict")
"""Additional columns if something was measured."""


def write_summary(ledger: BatchLedger, out: Path, *, measured: bool) -> Path:
    """Write the table of all completed frames in a run's folder.

    Parameters
    ----------
    ledger : BatchLedger
        Ledger of the run.
    out : Path
        Folder of the run.
    measured : bool
        Whether there are columns for a measurement.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InputError
        If the file cannot be written, or the ledger cannot be read.
    """

    def write(stream: BinaryIO) -> None:
        text = io.TextIOWrapper(stream, "utf-8", "backslashreplace", newline="")
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow((*COLUMNS, *MEASURED) if measured else COLUMNS)
        for row in ledger.rows():
            writer.writerow([*_cells(row), *(_measured_cells(row) if measured else ())])
        text.flush()
        text.detach()

    write_atomically(out / FILE, write)
    return out / FILE


def _cells(row: FrameRow) -> list[str]:
    values = {column: getattr(row, column) for column in COLUMNS}
    values |= {"notes": "; ".join(row.notes), "error": last_line(row.error)}
    return [_cell(value) for value in values.values()]


def _measured_cells(row: FrameRow) -> list[str]:
    return [_cell((row.measured or {}).get(column)) for column in MEASURED]


def _cell(value: object) -> str:
    if isinstance(value, list):
        return " ".join(map(_cell, value))
    return "" if value is None else repr(value) if isinstance(value, float) else str(value)


def last_line(text: str) -> str:
    """Return the last line, which in the report of an error gives its cause."""
    return text.splitlines()[-1] if text else ""
