"""What became of each frame: a file with one line per frame, and the table made from it.

The files of a frame are complete before its line is written. A line truncated by a crash is
ignored: that frame is repeated. If there are two lines for one frame, the later one counts.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any, BinaryIO

from gelpolight_core.io.atomic import append_json, write_atomically
from gelpolight_core.io.reading import json_lines, open_file, parse_json

FILE = "batch.jsonl"
SUMMARY = "batch.csv"
MEASURED = ("shape", "diameter_mm", "side_mm", "height_mm", "centre_mm", "yaw_deg", "verdict")
"""Additional columns if something was measured."""
LEFT_OUT = ("stamp", "measured", "internal")
"""Fields of a row that are no columns."""


@dataclass(frozen=True, slots=True)
class FrameRow:
    """The result of a frame.

    Attributes
    ----------
    output : str
        Its files in the run's folder, without extensions.
    stamp : str
        Identifies the frame; another stamp means another frame.
    input : str
        Image or recording.
    frame : int or None
        Index of the frame in the recording, from 0; None for an image.
    number, time_s : int or None, float or None
        As in :class:`~gelpolight_core.recording.recording.RecordedFrame`.
    max_depth_mm : float or None
        Largest depth in the working area.
    volume_mm3 : float or None
        Integral of the depth over the working area.
    flagged_share : float or None
        Share of the working area whose depth is flagged, 0..1.
    notes : tuple of str
        Notes on the result.
    measured : dict or None
        The measurement, as written by ``measure --json``.
    seconds : float
        Processor time.
    error : str
        Why there is no result; empty if there is one.
    internal : bool
        Whether it is an internal error of this program.
    """

    output: str
    stamp: str
    input: str
    frame: int | None = None
    number: int | None = None
    time_s: float | None = None
    max_depth_mm: float | None = None
    volume_mm3: float | None = None
    flagged_share: float | None = None
    notes: tuple[str, ...] = ()
    measured: dict[str, Any] | None = None
    seconds: float = 0.0
    error: str = ""
    internal: bool = False


def finished_frames(out: Path) -> set[tuple[str, str]]:
    """Return output and stamp of each frame of a run that has a result.

    Raises
    ------
    InputError
        If the file of the rows cannot be read.
    """
    rows = (row for _, row in _lines(out / FILE))
    return {(row.output, row.stamp) for row in rows if row is not None and not row.error}


def damaged_lines(out: Path) -> int:
    """Return how many lines of a run's file are damaged; their frames count as not finished."""
    return sum(row is None for _, row in _lines(out / FILE))


def keep_rows(rows: Sequence[FrameRow], out: Path) -> None:
    """Append rows to the file in a run's folder, and flush them to disk.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    append_json(out / FILE, map(asdict, rows))


def write_summary(out: Path, *, measured: bool) -> None:
    """Write the table of all frames of a run, by the name of their output.

    Parameters
    ----------
    out : Path
        Folder of the run.
    measured : bool
        Whether there are columns for a measurement.

    Raises
    ------
    InputError
        If the file cannot be written, or the rows cannot be read.
    """
    # Only the positions are kept in memory: there may be millions of frames.
    positions = {row.output: at for at, row in _lines(out / FILE) if row is not None}
    columns = [field.name for field in fields(FrameRow) if field.name not in LEFT_OUT]

    def write(stream: BinaryIO) -> None:
        text = io.TextIOWrapper(stream, "utf-8", "backslashreplace", newline="")
        writer = csv.writer(text, lineterminator="\n")
        writer.writerow(columns + list(MEASURED if measured else ()))
        with open_file(out / FILE) as file:
            for output in sorted(positions, key=_in_order):
                file.seek(positions[output])
                row = parse_json(file.readline())
                row |= {"notes": "; ".join(row["notes"]), "error": last_line(row["error"])}
                cells = [row[name] for name in columns]
                if measured:
                    found = row["measured"] or {}
                    cells += [
                        " ".join(map(str, value)) if isinstance(value, list) else value
                        for value in map(found.get, MEASURED)
                    ]
                writer.writerow(cells)
        text.flush()
        text.detach()

    write_atomically(out / SUMMARY, write)


def _lines(path: Path) -> Iterator[tuple[int, FrameRow | None]]:
    """Yield the position and the row of each line of a file; None for a damaged line."""
    for position, content in json_lines(path):
        row = None
        with suppress(TypeError):
            row = FrameRow(**content)
        yield position, row


def last_line(text: str) -> str:
    """Return the last line, which in the report of an error gives its cause."""
    return text.splitlines()[-1] if text else ""


def _in_order(output: str) -> list[str | int]:
    """Return a key that sorts numbers in names by value, whatever their number of digits."""
    return [int(part) if part.isdecimal() else part for part in re.split(r"(\d+)", output)]
