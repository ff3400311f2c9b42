"""The workspace: a folder with one folder per sensor, holding its calibrations and sessions.

::

    workspace.json                       which calibration is in use
    sensors/SERIAL/NAME.gplcal           calibrations, and NAME.validation.json beside them
    sensors/SERIAL/sessions/NAME/        session folders
    sensors/SERIAL/recordings/TIME.gplrec
    records.sqlite                       what was measured
    sensors/SERIAL/protocols/NAME/       runs of the evaluation protocol
    trash/TIME-NUMBER/                   what was removed, with its old place
"""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Iterable
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import platformdirs

from app.workspace.entries import Entry, read_entry
from app.workspace.sessions import DESCRIPTION, SessionEntry, read_session_entry
from app.workspace.validation import validation_path
from gelpolight_core.calibration.manifest import read_summary, refuse_damaged_arrays
from gelpolight_core.errors import InputError
from gelpolight_core.export.atomic import NameTakenError, make_folder, write_atomically
from gelpolight_core.reading import open_file, parse_json, read_file
from gelpolight_core.translation import tr

if TYPE_CHECKING:
    from gelpolight_core.calibration.calibration import Calibration
    from gelpolight_core.records.records import Records

ENDING = ".gplcal"
STATE = "workspace.json"
COPY_BYTES = 1 << 20
NAME_BYTES = 160
DEVICES = {"CON", "PRN", "AUX", "NUL", *(f"{n}{k}" for n in ("COM", "LPT") for k in range(10))}


@dataclass(frozen=True, slots=True)
class Removal:
    """A calibration in the trash: enough to put it back.

    Attributes
    ----------
    place : Path
        Where the calibration file was.
    moved : tuple of (Path, Path)
        From where to where, for each file.
    was_in_use : bool
        Whether it was the one in use.
    """

    place: Path
    moved: tuple[tuple[Path, Path], ...]
    was_in_use: bool


class Workspace:
    """The folder in which sensors, calibrations and sessions are kept.

    Parameters
    ----------
    folder : Path
        It need not exist; it is made when something is put into it.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._records: Records | None = None

    @property
    def records(self) -> Records:
        """What was measured; opened when it is first asked for, begun where there is none.

        Raises
        ------
        InputError
            If it cannot be opened or made.
        """
        from gelpolight_core.records.records import NAME, Records  # the window is up before NumPy

        path = self.folder / NAME
        if self._records is None or self._records.path != path:
            self.close()
            make_folder(self.folder)
            self._records = Records.open(path)
        return self._records

    def close(self) -> None:
        """Let the records go; they are opened again when they are asked for."""
        records, self._records = self._records, None
        if records is not None:
            records.close()

    @property
    def sensors_folder(self) -> Path:
        """The folder of all sensors."""
        return self.folder / "sensors"

    def sensor_folder(self, serial: str) -> Path:
        """Return the folder of one sensor, whatever its serial is made of."""
        return self.sensors_folder / folder_name(serial)

    def sessions_folder(self, serial: str) -> Path:
        """Return where the sessions of a sensor are kept."""
        return self.sensor_folder(serial) / "sessions"

    def recordings_folder(self, serial: str) -> Path:
        """Return where the recordings of a sensor are kept."""
        return self.sensor_folder(serial) / "recordings"

    def recording_path(self, serial: str) -> Path:
        """Return a place for a new recording, named after the time; its folder is made."""
        from gelpolight_core.recording.recording import ENDING

        folder = self.recordings_folder(serial)
        make_folder(folder)
        stamp = datetime.now().astimezone().strftime("%Y-%m-%d_%H-%M-%S")
        return _free(folder / f"{stamp}{ENDING}")

    def protocols_folder(self, serial: str) -> Path:
        """Return where the runs of the evaluation protocol on a sensor are kept."""
        return self.sensor_folder(serial) / "protocols"

    def protocols(self) -> tuple[Path, ...]:
        """Return the folder of every run of the evaluation protocol, the newest first.

        Raises
        ------
        InputError
            If the workspace is there but cannot be read.
        """
        try:
            found = [p.parent for p in self.sensors_folder.glob("*/protocols/[!.]*/protocol.toml")]
        except OSError as error:
            raise self._unreadable(error) from error
        return tuple(sorted(found, key=lambda folder: folder.name, reverse=True))

    def calibration_path(self, serial: str, name: str) -> Path:
        """Return a place for a new calibration that no other file has; its folder is made."""
        folder = self.sensor_folder(serial)
        make_folder(folder)
        return _free(folder / f"{folder_name(name)}{ENDING}")

    def keep_calibration(self, calibration: Calibration, name: str) -> Path:
        """Write a new calibration into the library, whole or not at all; return its place.

        Another program that uses the workspace may take a name at this moment.

        Raises
        ------
        InputError
            If it cannot be written.
        """
        from gelpolight_core.calibration.file import write_calibration

        while True:
            path = self.calibration_path(calibration.sensor.serial, name)
            try:
                write_calibration(calibration, path, new=True)
            except NameTakenError:
                continue
            return path

    def entries(self) -> tuple[Entry, ...]:
        """Return every calibration, by sensor, newest first; broken ones too.

        Raises
        ------
        InputError
            If the workspace is there but cannot be read.
        """
        in_use = self.in_use
        try:
            files = sorted(self.sensors_folder.glob(f"*/[!.]*{ENDING}"))
        except OSError as error:
            raise self._unreadable(error) from error
        return _in_order(read_entry(path, in_use=path == in_use) for path in files)

    def sessions(self) -> tuple[SessionEntry, ...]:
        """Return every session, by sensor, the one last worked at first.

        Raises
        ------
        InputError
            If the workspace is there but cannot be read.
        """
        try:
            found = self.sensors_folder.glob(f"*/sessions/[!.]*/{DESCRIPTION}")
            entries = [read_session_entry(path.parent) for path in found]
        except OSError as error:
            raise self._unreadable(error) from error
        return tuple(sorted(entries, key=lambda e: (e.serial, -e.changed.timestamp())))

    @property
    def in_use(self) -> Path | None:
        """The calibration in use; None where none was chosen or it is gone."""
        try:
            stored = parse_json(read_file(self.folder / STATE))["in_use"]
            path = self.folder / stored
            inside = ".." not in path.parts and path.is_relative_to(self.sensors_folder)
            return path if inside and path.is_file() else None
        except (InputError, OSError, ValueError, TypeError, KeyError):
            return None  # a lost choice is made again by a click

    def use(self, path: Path | None) -> None:
        """Choose the calibration that is measured with, or none.

        Raises
        ------
        InputError
            If the file is broken, outside of the workspace, or the choice cannot be kept.
        """
        if path is not None:
            read_summary(path)
            self._refuse_outside(path)
        text = json.dumps({"in_use": path and path.relative_to(self.folder).as_posix()}) + "\n"
        make_folder(self.folder)
        _write_bytes(self.folder / STATE, text.encode())

    def import_calibration(self, source: Path) -> Path:
        """Copy a calibration file into the folder of its sensor, whole or not at all.

        A file that is in the library already is not copied again.

        Returns
        -------
        path : Path
            Where it is kept.

        Raises
        ------
        InputError
            If the file is broken or cannot be copied.
        """
        summary = read_summary(source)
        folder = self.sensor_folder(summary.serial)
        make_folder(folder)
        for known in folder.glob(f"[!.]*{ENDING}"):
            entry = read_entry(known)
            if entry.summary is not None and entry.summary.identity == summary.identity:
                return known
        refuse_damaged_arrays(source)
        target = _copy_new(source, folder / f"{folder_name(source.stem)}{ENDING}")
        beside = validation_path(source)
        if beside.is_file():
            try:
                _copy(beside, validation_path(target))
            except InputError:
                target.unlink(missing_ok=True)
                raise
        return target

    def remove(self, path: Path) -> Removal:
        """Move a calibration and its validation into the trash folder.

        Raises
        ------
        InputError
            If it is outside of the workspace or cannot be moved.
        """
        self._refuse_outside(path)
        was_in_use = self.in_use == path
        stamp = datetime.now(UTC).strftime("%Y%m%d-%H%M%S")
        trash = _free(self.folder / "trash" / f"{stamp}-{path.parent.name}")
        make_folder(trash)
        moved = []
        for file in (path, validation_path(path)):
            if file.exists():
                _move(file, trash / file.name)
                moved.append((file, trash / file.name))
        if was_in_use:
            self.use(None)
        return Removal(path, tuple(moved), was_in_use)

    def restore(self, removal: Removal) -> None:
        """Put a removed calibration back.

        Raises
        ------
        InputError
            If its place was taken meanwhile or the trash was emptied.
        """
        for place, _ in removal.moved:
            if place.exists():
                raise InputError(
                    tr("another file has taken its place"),
                    where=str(place),
                    advice=tr("Rename that file, then import this one from the trash folder"),
                )
        for place, trashed in removal.moved:
            make_folder(place.parent)
            _move(trashed, place)
        for folder in {trashed.parent for _, trashed in removal.moved}:
            if not any(folder.iterdir()):
                folder.rmdir()
        if removal.was_in_use:
            self.use(removal.place)

    def _unreadable(self, error: OSError) -> InputError:
        return InputError(
            tr("the workspace cannot be read ({reason})").format(reason=error.strerror),
            where=str(self.folder),
            advice=tr("Check its permissions, or choose another folder in the preferences"),
        )

    def _refuse_outside(self, path: Path) -> None:
        if not path.is_relative_to(self.sensors_folder):
            raise InputError(
                tr("the calibration is not in the library"),
                where=str(path),
                advice=tr("Import it first"),
            )


def default_folder() -> Path:
    """Return where the workspace is unless the person chose another place."""
    return platformdirs.user_documents_path() / "GelPoLight"


def folder_name(text: str) -> str:
    """Return a name that every file system takes, for any text."""
    name = re.sub(r"[^\w.+-]+", "_", text).strip("._ ")[:80]
    # A letter may take four bytes, and names end at 255; Windows keeps some names for devices.
    name = name.encode("utf-8", "ignore")[:NAME_BYTES].decode("utf-8", "ignore").rstrip("._ ")
    if name.split(".")[0].upper() in DEVICES:
        name = f"{name}_" if "." not in name else f"_{name}"
    return name or "unnamed"


def _in_order(entries: Iterable[Entry]) -> tuple[Entry, ...]:
    oldest = datetime.min.replace(tzinfo=UTC)
    newest_first = sorted(entries, key=lambda e: e.created or oldest, reverse=True)
    return tuple(sorted(newest_first, key=lambda e: e.serial))


def _free(path: Path) -> Path:
    """Return `path`, or the like with a number where that is taken."""
    candidate, number = path, 1
    while candidate.exists():
        number += 1
        candidate = path.with_name(f"{path.stem}-{number}{path.suffix}")
    return candidate


def _write_bytes(path: Path, data: bytes) -> None:
    def write(stream: BinaryIO) -> None:
        stream.write(data)

    write_atomically(path, write)


def _copy_new(source: Path, wanted: Path) -> Path:
    """Copy a file to a place that no other has, and return that."""
    while True:
        target = _free(wanted)
        try:
            _copy(source, target, new=True)
        except NameTakenError:
            continue
        return target


def _copy(source: Path, target: Path, *, new: bool = False) -> None:
    try:
        stream = open_file(source)
    except OSError as error:
        raise _refused(error, source) from error
    with stream:
        write_atomically(target, lambda out: shutil.copyfileobj(stream, out, COPY_BYTES), new=new)


def _move(source: Path, target: Path) -> None:
    try:
        os.replace(source, target)
    except OSError as error:
        raise _refused(error, source) from error


def _refused(error: OSError, path: Path) -> InputError:
    return InputError(
        tr("the system refuses it ({reason})").format(reason=error.strerror or error),
        where=str(path),
        advice=tr("Check the name, the permissions and the disk"),
    )
