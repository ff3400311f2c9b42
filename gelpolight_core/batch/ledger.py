"""The ledger of a run, one line per frame; a frame counts once its line is on disk.

The files of a frame are complete before its line is written. A line truncated by a crash is
ignored: that frame is repeated. If there are two lines for one result, the later one counts.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from gelpolight_core.io.appending import append_durably
from gelpolight_core.io.reading import open_file, parse_json, unreadable

FILE = "batch.jsonl"


@dataclass(frozen=True, slots=True)
class FrameRow:
    """The ledger entry of a frame.

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
    ours : bool
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
    ours: bool = False


@dataclass(slots=True)
class _Entry:
    """Position of a result's line in the file."""

    stamp: str
    offset: int
    good: bool
    order: tuple[str, str, int]


class BatchLedger:
    """The file of a run's rows; only their positions are kept in memory.

    Parameters
    ----------
    path : Path
        The file, created with the first row.

    Raises
    ------
    InputError
        If the file exists and cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._entries: dict[str, _Entry] = {}
        self._end, self._torn = 0, False
        if not path.exists():
            return
        try:
            with open_file(path) as file:
                for line in file:
                    self._take_in(line)
        except OSError as error:
            raise unreadable(error, path) from error

    def has(self, output: str, stamp: str) -> bool:
        """Return whether a frame has a result."""
        entry = self._entries.get(output)
        return entry is not None and entry.good and entry.stamp == stamp

    def keep(self, rows: Sequence[FrameRow]) -> None:
        """Append rows to the file, and flush them to disk.

        Raises
        ------
        InputError
            If the file cannot be written.
        """
        lines = [_packed(row) for row in rows]
        if not lines:
            return
        append_durably(self._path, (b"\n" if self._torn else b"") + b"".join(lines))
        if self._torn:
            self._end, self._torn = self._end + 1, False
        for row, line in zip(rows, lines, strict=True):
            self._note(row, len(line))

    def rows(self) -> Iterator[FrameRow]:
        """Return the valid rows, by folder, input and frame, each read from the file.

        Raises
        ------
        InputError
            If the file can no longer be read.
        """
        entries = sorted(self._entries.values(), key=lambda entry: entry.order)
        if not entries:
            return
        try:
            with self._path.open("rb") as file:
                for entry in entries:
                    file.seek(entry.offset)
                    row = _unpacked(file.readline())
                    assert row is not None
                    yield row
        except OSError as error:
            raise unreadable(error, self._path) from error

    def _take_in(self, line: bytes) -> None:
        """Index one line; an invalid line is skipped."""
        row = _unpacked(line)
        if row is None:
            self._end += len(line)
        else:
            self._note(row, len(line))
        self._torn = not line.endswith(b"\n")

    def _note(self, row: FrameRow, size: int) -> None:
        folder = row.output.rpartition("/")[0]
        frame = -1 if row.frame is None else row.frame
        # Frames of a recording stay in order, whatever their number of digits.
        name = row.output if row.frame is None else row.input
        order = (folder, name, frame)
        self._entries[row.output] = _Entry(row.stamp, self._end, not row.error, order)
        self._end += size


def _packed(row: FrameRow) -> bytes:
    """Return a row as a line; JSON keeps the exact value of numbers."""
    return json.dumps(asdict(row), separators=(",", ":")).encode() + b"\n"


def _unpacked(line: bytes) -> FrameRow | None:
    """Return the row of a line; None if the line is not complete."""
    if not line.endswith(b"\n"):
        return None
    try:
        content = parse_json(line)
        row = FrameRow(**{**content, "notes": tuple(map(str, content["notes"]))})
    except (ValueError, TypeError, KeyError, AttributeError):
        return None
    texts = (row.output, row.stamp, row.input, row.error)
    whole = row.frame is None or type(row.frame) is int
    return row if whole and all(isinstance(text, str) for text in texts) else None
