"""The table of a run: one line for each frame, added once its files are complete.

A line cut off by a crash is ignored: that frame is computed again. If there are two lines for a
frame, the later one counts.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from gelpolight_core.base.atomic_write import append_with_fsync, write_text
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.safe_reading import cannot_read, escape_undecodable, open_file

TABLE, EARLIER = "batch.csv", "batch.earlier.csv"
COLUMNS = tuple(
    "output input frame number time_s max_depth_mm volume_mm3 flagged_share notes shape "
    "diameter_mm side_mm height_mm centre_mm yaw_deg verdict seconds calibration_id origin "
    "error".split()
)


@dataclass(frozen=True, slots=True)
class FrameRow:
    """One line of the table of a run: the result of a frame.

    Attributes
    ----------
    output : str
        Its files in the run's folder, without extensions.
    input : str
        Image or recording.
    calibration_id : str
        Identity of the calibration.
    origin : str
        What else the result depends on: settings, and the state of the input.
    frame : int or None
        Index of the frame in the recording, from 0; None for an image.
    number, time_s : int or None, float or None
        As in :class:`~gelpolight_core.output.recording.recording_format.RecordedFrame`.
    max_depth_mm : float or None
        Largest depth in the working area.
    volume_mm3 : float or None
        Integral of the depth over the working area.
    flagged_share : float or None
        Share of the working area whose depth is flagged, 0..1.
    notes : tuple of str
        Notes on the result.
    measured : mapping
        The measurement, as written by ``measure --json``; empty without one.
    seconds : float
        Processor time.
    error : str
        Why there is no result; empty if there is one.
    internal : bool
        Whether it is an internal error of this program; its report has several lines.
    """

    output: str
    input: str
    calibration_id: str
    origin: str
    frame: int | None = None
    number: int | None = None
    time_s: float | None = None
    max_depth_mm: float | None = None
    volume_mm3: float | None = None
    flagged_share: float | None = None
    notes: tuple[str, ...] = ()
    measured: Mapping[str, Any] = field(default_factory=dict)
    seconds: float = 0.0
    error: str = ""
    internal: bool = False

    def line(self) -> str:
        """Return its line of the table, without the end of line."""
        values = {**self.measured, **asdict(self)}
        # The last line of an internal error gives its cause.
        values |= {"notes": "; ".join(self.notes), "error": self.error.rstrip().rpartition("\n")[2]}
        return _line([values.get(name) for name in COLUMNS])


def read_table(out: Path) -> dict[str, dict[str, str]]:
    """Return the lines of a run's table by their output, none without a table.

    A table with other columns is kept aside as :data:`EARLIER`.

    Raises
    ------
    InputError
        If the file cannot be read.
    """
    try:
        with open_file(out / TABLE) as file:
            content = file.read().decode("utf-8-sig", "replace").replace("\r\n", "\n")
            header, *lines = content.split("\n")
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise cannot_read(error, out / TABLE) from error
    table: dict[str, dict[str, str]] = {}
    if header != _line(COLUMNS):
        if content:  # of an earlier version, or another program has changed it
            (out / TABLE).replace(out / EARLIER)
        return {}
    for line in lines[:-1]:  # behind the last end of line is nothing, or a line cut off
        with suppress(csv.Error, ValueError):
            (cells,) = csv.reader([line])
            table[cells[0]] = dict(zip(COLUMNS, cells, strict=True))
    return table


def refuse_other_calibration(
    table: Mapping[str, Mapping[str, str]], calibration_id: str, out: Path
) -> None:
    """Refuse to put results of two calibrations into one folder.

    Raises
    ------
    InputError
        If the folder has results of another calibration.
    """
    others = {row["calibration_id"] for row in table.values()} - {calibration_id}
    if others:
        text = f"This folder has results of the calibration {min(others)}, not of {calibration_id}"
        raise InputError(text, out, Remedy.START_NEW)


def add_row(row: FrameRow, out: Path) -> None:
    """Add a line to the table in a run's folder, and flush it to disk.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    append_with_fsync(out / TABLE, f"{row.line()}\n".encode())


def write_table(table: Mapping[str, Mapping[str, str]], out: Path) -> None:
    """Write the table of a run, by the name of the output.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    rows = [_line(list(table[output].values())) for output in sorted(table, key=_in_order)]
    write_text(out / TABLE, "\n".join([_line(COLUMNS), *rows, ""]))


def _line(cells: Any) -> str:
    """Return cells as a line that contains no other end of line."""
    stream = io.StringIO()
    plain = (
        " ".join(map(str, c)) if isinstance(c, list) else "" if c is None else c for c in cells
    )
    csv.writer(stream, lineterminator="").writerow(
        [escape_undecodable(str(c)).replace("\n", " ") for c in plain]
    )
    return stream.getvalue().replace("\r", " ")


def _in_order(output: str) -> list[str | int]:
    """Return a key that sorts numbers in names by value, whatever their number of digits."""
    return [int(part) if part.isdecimal() else part for part in re.split(r"(\d+)", output)]
