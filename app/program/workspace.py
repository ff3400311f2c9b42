"""The workspace: a folder with one folder per sensor, containing its calibrations and sessions.

::

    workspace.json                       the calibration put into use last
    sensors/SERIAL/NAME.gplcal           calibrations
    sensors/SERIAL/sessions/NAME/        session folders
    sensors/SERIAL/recordings/TIME.gplrec
    sensors/SERIAL/measured/TIME.png     live images of saved measurements
    records.sqlite                       measurements
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import platformdirs

from gelpolight_core.base.atomic_write import (
    NameTakenError,
    cannot_write,
    make_folder,
    write_atomically,
    write_json,
)
from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.safe_reading import open_file, parse_json, read_file
from gelpolight_core.calibration.manifest import read_summary, refuse_damaged_arrays
from gelpolight_core.session.validation import validation_path

from .calibration_entries import (
    ENDING,
    CalibrationEntry,
    calibrations_in,
    read_entry,
    refuse_unlisted,
)
from .session_entries import DESCRIPTION, SessionEntry, is_session, read_session_entry


def unused_path(path: Path) -> Path:
    """Return `path`, or a similar path with a number if it exists."""
    candidate, number = path, 1
    while candidate.exists():
        number += 1
        candidate = path.with_name(f"{path.stem}-{number}{path.suffix}")
    return candidate


def write_new(path: Path, write: Callable[[Path], object]) -> Path:
    """Write a file to an unused path, and return that path.

    Another program may take the same name at this moment: `write` then raises NameTakenError.
    """
    while True:
        target = unused_path(path)
        try:
            write(target)
        except NameTakenError:
            continue
        return target


def copy_file(source: Path, target: Path, *, new: bool = False) -> None:
    """Copy a file. With `new`, the target must not exist."""
    try:
        stream = open_file(source)
    except OSError as error:
        message = f"The operating system refused it ({error.strerror or error})"
        raise InputError(message, source, Remedy.CHECK_DISK) from error
    with stream:
        write_atomically(target, lambda out: shutil.copyfileobj(stream, out, 1 << 20), new=new)


if TYPE_CHECKING:
    from gelpolight_core.base.arrays import FrameArray
    from gelpolight_core.base.store import Store
    from gelpolight_core.sensor.sensor_calibration import Calibration

STATE = "workspace.json"
DRAFT = "-draft"
DEVICES = {"CON", "PRN", "AUX", "NUL", *(f"{n}{k}" for n in ("COM", "LPT") for k in range(10))}


class Workspace:
    """The folder that contains sensors, calibrations and sessions.

    Parameters
    ----------
    folder : Path
        It need not exist. It is created when the first file is added.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._in_use: tuple[Path, Path | None] | None = None
        self._records: Store | None = None
        self.to_validate: Path | None = None
        """The calibration that the Validation step shows when its session is opened next."""

    @property
    def records(self) -> Store:
        """The measurements. Opened at first use, and created if there are none.

        Raises
        ------
        InputError
            If they cannot be opened or created.
        """
        # The window appears before NumPy is loaded.
        from gelpolight_core.lab.measurement_store import NAME, open_records

        path = self.folder / NAME
        if self._records is None or self._records.path != path:
            self.close()
            make_folder(self.folder)
            self._records = open_records(path)
        return self._records

    def uses(self, calibration_id: str) -> tuple[int, datetime | None]:
        """Return how many measurements were saved with a calibration, and when the last one was.

        Raises
        ------
        InputError
            If the records cannot be read.
        """
        from gelpolight_core.lab.measurement_record import MeasurementRecord
        from gelpolight_core.lab.measurement_store import NAME

        if not (self.folder / NAME).exists():
            return 0, None
        return self.records.count(MeasurementRecord, calibration_id=calibration_id)

    def close(self) -> None:
        """Close the records. The next use opens them again."""
        records, self._records = self._records, None
        if records is not None:
            records.close()

    @property
    def sensors_folder(self) -> Path:
        """The folder of all sensors."""
        return self.folder / "sensors"

    def sensor_folder(self, serial: str) -> Path:
        """Return the folder of a sensor, for any serial."""
        return self.sensors_folder / folder_name(serial)

    def sessions_folder(self, serial: str) -> Path:
        """Return the folder of a sensor's sessions."""
        return self.sensor_folder(serial) / "sessions"

    def recordings(self) -> tuple[Path, ...]:
        """Return the recordings of all sensors, newest first.

        Raises
        ------
        InputError
            If the workspace exists but cannot be read.
        """
        with self._reading():
            paths = list(self.sensors_folder.glob("*/recordings/[!.]*.gplrec"))
            return tuple(sorted(paths, key=lambda path: path.stat().st_mtime, reverse=True))

    def recording_path(self, serial: str) -> Path:
        """Return a path for a new recording, named after the time. Its folder is created."""
        from gelpolight_core.output.recording.recording_format import ENDING

        return self._dated_path(serial, "recordings", ENDING)

    def keep_image(self, rgb: FrameArray, serial: str) -> Path:
        """Write the live image of a saved measurement, named after the time. Return its path.

        Raises
        ------
        InputError
            If it cannot be written.
        """
        from gelpolight_core.session.session_images import write_image

        path = self._dated_path(serial, "measured", ".png")
        return write_new(path, partial(write_image, rgb, new=True))

    def _dated_path(self, serial: str, folder: str, ending: str) -> Path:
        parent = self.sensor_folder(serial) / folder
        make_folder(parent)
        return unused_path(parent / f"{datetime.now().astimezone():%Y-%m-%d_%H-%M-%S}{ending}")

    def calibration_path(self, serial: str, name: str) -> Path:
        """Return the path of a new calibration. Its folder is created."""
        folder = self.sensor_folder(serial)
        make_folder(folder)
        return folder / f"{folder_name(name)}{ENDING}"

    def keep_calibration(self, calibration: Calibration, name: str) -> Path:
        """Write a new calibration into the library, completely or not at all. Return its path.

        One that failed is named a draft.

        Raises
        ------
        InputError
            If it cannot be written.
        """
        from gelpolight_core.calibration.calibration_file import write_calibration

        if calibration.fault:
            name += DRAFT
        path = self.calibration_path(calibration.serial, name)
        return write_new(path, partial(write_calibration, calibration, new=True))

    def entries(self) -> tuple[CalibrationEntry, ...]:
        """Return every calibration, by sensor, newest first, including broken ones.

        Raises
        ------
        InputError
            If the workspace exists but cannot be read.
        """
        in_use, oldest = self.in_use, datetime.min.replace(tzinfo=UTC)
        with self._reading():
            files = calibrations_in(self.sensors_folder)
        entries = [read_entry(path, in_use=path == in_use) for path in files]
        entries.sort(key=lambda e: e.created or oldest, reverse=True)
        return tuple(sorted(entries, key=lambda e: e.serial))

    def entry_of(self, identity: str) -> CalibrationEntry | None:
        """Return a calibration of the library by its identity, or None."""
        entries = (e for e in self.entries() if e.summary and e.summary.identity == identity)
        return next(entries, None)

    def sessions(self, elsewhere: Iterable[Path] = ()) -> tuple[SessionEntry, ...]:
        """Return every session, by sensor, the last changed first.

        Parameters
        ----------
        elsewhere : iterable of Path, optional
            Folders outside the workspace. Those that are no sessions are left out.

        Raises
        ------
        InputError
            If the workspace exists but cannot be read.
        """
        with self._reading():
            descriptions = self.sensors_folder.glob(f"*/sessions/[!.]*/{DESCRIPTION}")
            folders = {path.parent for path in descriptions} | set(filter(is_session, elsewhere))
            entries = [read_session_entry(folder) for folder in folders]
        return tuple(sorted(entries, key=lambda e: (e.serial, -e.changed.timestamp())))

    @property
    def in_use(self) -> Path | None:
        """The calibration in use. None if none was selected or it no longer exists.

        Another window of the program, with another sensor, has its own: the file is only read at
        the start.
        """
        if self._in_use is None or self._in_use[0] != self.folder:
            self._in_use = self.folder, self._last_in_use()
        path = self._in_use[1]
        return path if path is not None and path.is_file() else None

    def _last_in_use(self) -> Path | None:
        try:
            path = self.folder / parse_json(read_file(self.folder / STATE))["in_use"]
        except (InputError, OSError, ValueError, TypeError, KeyError):
            return None  # the user can easily select it again
        inside = ".." not in path.parts and path.is_relative_to(self.sensors_folder)
        return path if inside else None

    def use(self, path: Path | None) -> None:
        """Select the calibration in use, or none.

        Raises
        ------
        InputError
            If the file is broken or outside the workspace, if it failed and nobody accepted that,
            or if the selection cannot be saved.
        """
        if path is not None:
            summary = read_summary(path)
            self._refuse_outside(path)
            if summary.fault and not summary.accepted:
                advice = "Calibrate again, or use it on the Sensors page with a reason"
                raise InputError(summary.fault.text, path, advice)
        make_folder(self.folder)
        in_use = path and path.relative_to(self.folder).as_posix()
        write_json(self.folder / STATE, {"in_use": in_use})
        self._in_use = self.folder, path

    def import_calibration(self, source: Path) -> Path:
        """Copy a calibration file into the folder of its sensor, completely or not at all.

        A file that is already in the library is not copied again.

        Returns
        -------
        path : Path
            Path of the file in the library.

        Raises
        ------
        InputError
            If the file is no calibration, is broken or cannot be copied.
        """
        if source.suffix.lower() != ENDING:
            text = f"This is not a calibration (*{ENDING})"
            raise InputError(text, source.name, Remedy.CHOOSE_FILE)
        summary = read_summary(source)
        for path in self.sensor_folder(summary.serial).glob(f"[!.]*{ENDING}"):
            entry = read_entry(path)
            if entry.summary is not None and entry.summary.identity == summary.identity:
                return path
        refuse_damaged_arrays(source)
        new_path = self.calibration_path(summary.serial, source.stem)
        target = write_new(new_path, partial(copy_file, source, new=True))
        validation = validation_path(source)
        if validation.is_file():
            try:
                copy_file(validation, validation_path(target))
            except InputError:
                target.unlink(missing_ok=True)
                raise
        return target

    def rename(self, path: Path, name: str) -> Path:
        """Rename a calibration, and a validation beside it. Their content stays. Return its path.

        Raises
        ------
        InputError
            If it is outside the workspace, another one has the name, or the system refuses it.
        """
        self._refuse_outside(path)
        target, is_used = path.with_name(f"{folder_name(name)}{ENDING}"), self.in_use == path
        if target.exists():
            raise NameTakenError("A calibration has this name already", target, Remedy.CHOOSE_NAME)
        try:
            for file, renamed in zip(_files(path), _files(target), strict=True):
                if file.exists():
                    file.replace(renamed)
        except OSError as error:
            raise cannot_write(error, target) from error
        if is_used:
            self.use(target)
        return target

    def remove(self, path: Path, discard: Callable[[Path], bool]) -> None:
        """Move a calibration, and a validation beside it, to the trash of the system.

        Parameters
        ----------
        path : Path
            The calibration.
        discard : callable
            Moves a file to the trash. Returns whether it did.

        Raises
        ------
        InputError
            If it is outside the workspace, or the system has no trash for it: it stays.
        """
        self._refuse_outside(path)
        was_in_use = self.in_use == path
        for file in filter(Path.exists, _files(path)):
            if not discard(file):
                message = "The system has no trash for this file, so it was not deleted"
                raise InputError(message, file, "Delete it in the file manager")
        if was_in_use:
            self.use(None)

    @contextmanager
    def _reading(self) -> Iterator[None]:
        """Report that the workspace cannot be read."""
        try:
            yield
        except OSError as error:
            message = f"The workspace cannot be read ({error.strerror})"
            raise InputError(message, self.folder, Remedy.CHECK_DISK) from error

    def _refuse_outside(self, path: Path) -> None:
        refuse_unlisted(path)
        if not path.is_relative_to(self.sensors_folder):
            text = "The calibration is not in the library"
            raise InputError(text, path, Remedy.IMPORT_CALIBRATION)


def default_folder() -> Path:
    """Return the default folder of the workspace."""
    return platformdirs.user_documents_path() / "GelPoLight"


def folder_name(text: str) -> str:
    """Return a name that is valid on every file system, for any text."""
    name = re.sub(r"[^\w.+-]+", "_", text).strip("._ ")[:80]
    # A letter may use four bytes, and names are limited to 255. Windows reserves some names for
    # devices.
    name = name.encode("utf-8", "ignore")[:160].decode("utf-8", "ignore").rstrip("._ ")
    if name.split(".")[0].upper() in DEVICES:
        name = f"{name}_" if "." not in name else f"_{name}"
    return name or "unnamed"


def _files(calibration: Path) -> tuple[Path, Path]:
    """Return the file of a calibration, and that of a validation beside it."""
    return calibration, validation_path(calibration)
