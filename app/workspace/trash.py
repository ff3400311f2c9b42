"""The trash folder of a workspace: removed calibrations, each with its origin.

``trash/TIME-SERIAL/`` holds the calibration and ``removal.json`` with the folder that it came from,
the time, and whether the calibration was in use; beside them the validation that an older program
has written.
"""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path

from app.workspace.entries import Entry, calibrations_in, read_entry
from app.workspace.files import free_path, move_file
from app.workspace.sessions import file_time
from gelpolight_core.errors import InputError
from gelpolight_core.io.atomic import make_folder, write_json
from gelpolight_core.io.reading import parse_json, parse_time, plain_text, read_file
from gelpolight_core.validation import validation_path

NOTE = "removal.json"


@dataclass(frozen=True, slots=True)
class Removal:
    """A calibration in the trash, with the data to restore it.

    Attributes
    ----------
    old_path : Path
        Old path of the calibration file.
    trashed : Path
        Its path in the trash.
    when : datetime
        Time of the removal.
    was_in_use : bool
        Whether it was the one in use.
    """

    old_path: Path
    trashed: Path
    when: datetime
    was_in_use: bool

    @property
    def entry(self) -> Entry:
        """Description of the calibration, with its validation."""
        return read_entry(self.trashed)


def put_into_trash(workspace: Path, path: Path, *, was_in_use: bool) -> Removal:
    """Move a calibration of the library and its validation into the trash.

    Raises
    ------
    InputError
        If it cannot be moved. Then it stays where it was.
    """
    now = datetime.now(UTC)
    folder = free_path(workspace / "trash" / f"{now:%Y%m%d-%H%M%S}-{path.parent.name}")
    make_folder(folder)
    note = {"folder": path.parent.name, "when": now.isoformat(), "in_use": was_in_use}
    write_json(folder / NOTE, note)
    moved: list[Path] = []
    try:
        for file in (path, validation_path(path)):
            if file.exists():
                move_file(file, folder / file.name)
                moved.append(file)
    except InputError:
        for file in moved:
            move_file(folder / file.name, file)
        _clear(folder)
        raise
    return Removal(path, folder / path.name, now, was_in_use)


def removals_in(workspace: Path) -> tuple[Removal, ...]:
    """Return the calibrations in the trash of a workspace, the last removed first."""
    removals = [_read(workspace, path) for path in calibrations_in(workspace / "trash")]
    return tuple(sorted(removals, key=lambda removal: removal.when, reverse=True))


def take_from_trash(removal: Removal) -> None:
    """Move a calibration and its validation back to where they were.

    Raises
    ------
    InputError
        If another file has its name now, or the trash was emptied.
    """
    pairs = [
        (removal.trashed, removal.old_path),
        (validation_path(removal.trashed), validation_path(removal.old_path)),
    ]
    pairs = [pair for pair in pairs if pair[0].exists() or pair[0] == removal.trashed]
    for _, old_path in pairs:
        if old_path.exists():
            raise InputError(
                "A new file now has the same name",
                old_path,
                "Rename that file, then restore this one from the trash",
            )
    make_folder(removal.old_path.parent)
    for trashed, old_path in pairs:
        move_file(trashed, old_path)
    _clear(removal.trashed.parent)


def _clear(folder: Path) -> None:
    """Remove a folder of the trash if nothing of the user is left in it."""
    if all(path.name == NOTE for path in folder.iterdir()):
        (folder / NOTE).unlink(missing_ok=True)
        folder.rmdir()


def _read(workspace: Path, trashed: Path) -> Removal:
    """Return a removal from its note; without a note, from the names and the time of the file."""
    # The name of the folder is the time (15 letters), a hyphen, and the name of the old folder.
    old_folder, when, in_use = trashed.parent.name[16:] or "unnamed", None, False
    try:
        note = parse_json(read_file(trashed.parent / NOTE, 10_000))
        name = plain_text(note["folder"], 200)
        if name == Path(name).name and name not in ("", ".", ".."):
            old_folder = name
        when, in_use = parse_time(str(note["when"])), note["in_use"] is True
    except (InputError, OSError, ValueError, TypeError, KeyError):
        pass  # removed by an older version, or edited: the names are enough
    if when is None:
        when = file_time(trashed.parent.stat().st_mtime)
    return Removal(workspace / "sensors" / old_folder / trashed.name, trashed, when, in_use)
