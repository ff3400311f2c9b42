"""A run of the evaluation protocol: a folder; the run can be stopped and continued at any time.

    protocol.toml   presses/*.png   presses/truth.csv   refused.csv   discarded/*.png

A press counts once ``truth.csv`` has a row for it; its image is written first. No other state is
stored, so an interrupted run continues with the press that was not finished.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.io.atomic import append_durably, cannot_write, make_folder, write_text
from gelpolight_core.io.reading import brief, read_file
from gelpolight_core.io.table import csv_text, read_csv
from gelpolight_core.measurement.evaluation import Crossing
from gelpolight_core.measurement.press import Press, read_truth
from gelpolight_core.measurement.protocol import (
    FILE_NAME,
    Protocol,
    ProtocolFile,
    check_protocol,
    read_protocol_file,
    write_protocol_file,
)
from gelpolight_core.session.images import average_frames, write_image

PRESSES, DISCARDED, REFUSED = "presses", "discarded", "refused.csv"
TRUTH = "truth.csv"
COLUMNS = (
    "file",
    "shape",
    "diameter_mm",
    "side_mm",
    "height_mm",
    "region",
    "repeat",
    "x_mm",
    "y_mm",
    "yaw_deg",
    "captured",
)


@dataclass(frozen=True, slots=True)
class RunProgress:
    """How far a run is.

    Attributes
    ----------
    done, total : int
        Presses.
    refused : int
        Presses that were refused and made again.
    object_done, object_total : int
        Presses of the object that is pressed next; 0 of 0 at the end.
    """

    done: int
    total: int
    refused: int
    object_done: int
    object_total: int

    @property
    def share(self) -> float:
        """Share done, 0..1."""
        return self.done / self.total


class ProtocolRun:
    """A run in its folder; made by :func:`begin_run` or :func:`open_run`.

    Attributes
    ----------
    folder : Path
        Where everything is.
    content : ProtocolFile
        What is pressed, on which sensor.
    """

    def __init__(self, folder: Path, content: ProtocolFile, rows: Mapping[str, list[str]]) -> None:
        self.folder, self.content = folder, content
        self.wanted = content.protocol.presses()
        self._rows = dict(rows)
        self._refused = _count_lines(folder / REFUSED)

    @property
    def protocol(self) -> Protocol:
        """What is pressed."""
        return self.content.protocol

    @property
    def presses(self) -> Path:
        """The folder of the images and ``truth.csv``."""
        return self.folder / PRESSES

    @property
    def done(self) -> tuple[Press, ...]:
        """The presses that count, in the protocol's order."""
        return tuple(press for press in self.wanted if press.file in self._rows)

    @property
    def left(self) -> tuple[Press, ...]:
        """The presses still to be made, in the protocol's order."""
        return tuple(press for press in self.wanted if press.file not in self._rows)

    @property
    def progress(self) -> RunProgress:
        """How far it is."""
        now = self.next()
        of_object = [p for p in self.wanted if now is not None and p.truth == now.truth]
        here = sum(press.file in self._rows for press in of_object)
        return RunProgress(len(self._rows), len(self.wanted), self._refused, here, len(of_object))

    def next(self) -> Press | None:
        """Return the next press; None at the end."""
        return next((press for press in self.wanted if press.file not in self._rows), None)

    def image(self, press: Press) -> Path:
        """Return the path of a press's image, which may not exist yet."""
        return self.presses / press.file

    def accept(self, press: Press, frames: Sequence[NDArray[Any]]) -> Path:
        """Keep a press: its frames averaged in one image, and its row in ``truth.csv``.

        Parameters
        ----------
        press : Press
            What was pressed.
        frames : sequence of (rows, columns, 3) uint8 or uint16
            RGB, of the steady press.

        Raises
        ------
        InputError
            If it cannot be written; the press is then requested again.
        """
        write_image(average_frames(frames), self.image(press))
        self.record(press)
        return self.image(press)

    def record(self, press: Press) -> None:
        """Count a press whose image exists already.

        Raises
        ------
        InputError
            If ``truth.csv`` cannot be written.
        """
        order = {wanted.file: k for k, wanted in enumerate(self.wanted)}
        # Rows that another program has added to the same run are kept.
        there = {
            row[0]: row
            for row in _read_rows(self.presses / TRUTH)
            if row[0] in order and (self.presses / row[0]).is_file()
        }
        rows = {**self._rows, **there, press.file: _row(press)}
        _write_rows([rows[file] for file in sorted(rows, key=order.__getitem__)], self.presses)
        self._rows = rows

    def refuse(self, press: Press, reason: str) -> None:
        """Log that a press was refused and why; it remains the next press.

        Raises
        ------
        InputError
            If the note cannot be written.
        """
        line = csv_text([_now(), press.file, reason], ())
        append_durably(self.folder / REFUSED, line.encode())
        self._refused += 1

    def take_back(self, press: Press) -> Path | None:
        """Mark a press to be repeated: move its image to ``discarded`` and return the new path.

        Raises
        ------
        InputError
            If the press is not done, or a file cannot be written.
        """
        if press.file not in self._rows:
            raise InputError("this press is not done yet", press.file, "Choose a finished press")
        # The row first: without its row, the image does not count, and no data are lost.
        rows = {file: row for file, row in self._rows.items() if file != press.file}
        _write_rows(list(rows.values()), self.presses)
        self._rows = rows
        image = self.image(press)
        if not image.is_file():
            return None
        make_folder(self.folder / DISCARDED)
        stamp = datetime.now(UTC).strftime("%Y%m%dT%H%M%S%f")
        kept = self.folder / DISCARDED / f"{image.stem}_{stamp}.png"
        try:
            os.replace(image, kept)
        except OSError as error:
            raise cannot_write(error, kept) from error
        return kept


def begin_run(folder: Path, protocol: Protocol, *, serial: str, calibration: str) -> ProtocolRun:
    """Make the folder of a new run.

    Parameters
    ----------
    folder : Path
        The folder. It may exist, but must not contain a run.
    protocol : Protocol
        What is pressed.
    serial : str
        Of the sensor.
    calibration : str
        Identity of the calibration.

    Raises
    ------
    InputError
        If the protocol cannot be pressed, the folder holds a run or presses already, or cannot be
        written.
    """
    check_protocol(protocol)
    for name in (FILE_NAME, PRESSES):
        if (folder / name).exists():
            raise InputError(f"the folder already contains {name}", folder, Remedy.START_NEW)
    make_folder(folder / PRESSES)
    content = ProtocolFile(protocol, serial, calibration)
    write_protocol_file(content, folder)
    return ProtocolRun(folder, content, {})


def open_run(folder: Path) -> ProtocolRun:
    """Open a run to continue it.

    Raises
    ------
    InputError
        If there is no run, or ``protocol.toml`` or ``truth.csv`` is damaged or of another protocol.
    """
    content = read_protocol_file(folder)
    presses = folder / PRESSES
    make_folder(presses)
    wanted = {press.file: press for press in content.protocol.presses()}
    rows: dict[str, list[str]] = {}
    for row in _read_rows(presses / TRUTH):
        press = wanted.get(row[0])
        if press is None or len(row) != len(COLUMNS) or row[1:-1] != _row(press)[1:-1]:
            raise InputError(
                f"the row of {brief(row[0])} does not belong to this protocol",
                presses / TRUTH,
                Remedy.REPAIR_FILE,
            )
        # A deleted image is requested again.
        if (presses / row[0]).is_file():
            rows[row[0]] = row
    return ProtocolRun(folder, content, rows)


def presses_folder(folder: Path) -> Path:
    """Return the folder of images and ``truth.csv`` that a run's or a session's folder holds.

    Raises
    ------
    InputError
        If ``truth.csv``, or the ``protocol.toml`` of a run, cannot be used.
    """
    inner = folder / PRESSES
    presses = inner if not (folder / TRUTH).is_file() and (inner / TRUTH).is_file() else folder
    read_truth(presses)
    crossing_of(presses)
    return presses


def crossing_of(presses: Path) -> Crossing | None:
    """Return the crossing of the series of a folder; None if the folder has no protocol.

    Parameters
    ----------
    presses : Path
        The folder of the images, in that of the run.

    Raises
    ------
    InputError
        If ``protocol.toml`` is damaged.
    """
    folder = presses.parent
    if presses.name != PRESSES or not (folder / FILE_NAME).is_file():
        return None
    return read_protocol_file(folder).protocol.crossing


def _row(press: Press) -> list[str]:
    truth = press.truth
    size = repr(truth.size_mm)
    sizes = ["", size] if truth.shape == "cuboid" else [size, ""]
    positions = [repr(press.position_mm[0]), repr(press.position_mm[1]), repr(press.yaw_deg)]
    return [
        press.file,
        truth.shape,
        *sizes,
        repr(truth.height_mm),
        press.region,
        press.repeat,
        *positions,
        _now(),
    ]


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="seconds")


def _write_rows(rows: Sequence[Sequence[str]], presses: Path) -> None:
    write_text(presses / TRUTH, csv_text(COLUMNS, rows))


def _read_rows(path: Path) -> list[list[str]]:
    try:
        lines = [row for _, row in read_csv(path)]
    except FileNotFoundError:
        return []
    if not lines or tuple(lines[0]) != COLUMNS:
        raise InputError("the first line is not that of a protocol run", path, Remedy.REPAIR_FILE)
    return lines[1:]


def _count_lines(path: Path) -> int:
    try:
        return read_file(path).count(b"\n")
    except FileNotFoundError:
        return 0
