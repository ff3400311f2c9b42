"""Files that are written whole or not at all."""

from __future__ import annotations

import contextlib
import errno
import os
import secrets
import stat
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

from gelpolight_core.errors import InputError
from gelpolight_core.translation import tr


class NameTakenError(InputError):
    """A new file cannot be written because there is one of its name."""


def write_atomically(
    path: Path,
    writer: Callable[[BinaryIO], object],
    *,
    new: bool = False,
    inside: Path | None = None,
) -> None:
    """Write a file in such a way that other programs see the old one or the new one whole.

    The bytes go to a temporary file in the same folder, are brought to the disk, and take the
    place of the old file in one step. When anything goes wrong, Ctrl-C included, the old file
    stays as it was and the temporary one is removed. A link is followed; the permissions of an
    older file are kept.

    Parameters
    ----------
    path : Path
        Where the file shall be; its folder must exist.
    writer : callable
        Gets the open binary file (which can seek) and writes into it.
    new : bool, optional
        Whether it never takes the place of another file, not even of one that another program
        writes at this moment.
    inside : Path, optional
        A folder that somebody else may have made: links in it that lead out of it are not
        followed.

    Raises
    ------
    NameTakenError
        Where a new file has the name of an old one.
    InputError
        Where the file cannot be written: no such folder, no permission, disk full.
    """
    target = _ordinary_target(path)
    if inside is not None and not target.is_relative_to(os.path.realpath(inside)):
        raise InputError(
            tr("it is a link that leads out of the folder"),
            where=str(path),
            advice=tr("Put the file or folder itself in the place of the link"),
        )
    try:
        _write_and_place(target, _temporary_for(target), writer, _place_new if new else os.replace)
    except FileExistsError as error:
        if not new:
            raise cannot_write(error, path) from error
        raise NameTakenError(
            tr("there is a file of this name"), where=str(path), advice=tr("Choose another name")
        ) from error
    except OSError as error:
        raise cannot_write(error, path) from error


def refuse_unwritable(path: Path) -> None:
    """Refuse a file that cannot be written, before the work that it shall hold is done.

    Raises
    ------
    InputError
        As :func:`write_atomically` would, but for the size of the disk.
    """
    target = _ordinary_target(path)
    temporary = _temporary_for(target)
    try:
        if target.is_dir():
            raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))
        temporary.open("xb").close()
        temporary.unlink()
    except OSError as error:
        raise cannot_write(error, path) from error


def make_folder(folder: Path) -> None:
    """Make a folder and those above it, unless it is there.

    Raises
    ------
    InputError
        Where it cannot be made, or a file of that name stands in the way.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise cannot_write(error, folder) from error


def _ordinary_target(path: Path) -> Path:
    """Return where a path leads; refuse what is no ordinary file."""
    target = Path(os.path.realpath(path))
    if target.exists() and not (target.is_file() or target.is_dir()):
        # Replacing it would put an ordinary file in the place of, say, /dev/full.
        raise InputError(
            tr("this is a device, not a file"),
            where=str(path),
            advice=tr("Name a file"),
        )
    return target


def _temporary_for(target: Path) -> Path:
    return target.with_name(f".{target.name[:200]}.{secrets.token_hex(4)}.part")


def _place_new(temporary: Path, target: Path) -> None:
    """Give a file its name, which no other file may have."""
    try:
        os.link(temporary, target)
    except FileExistsError:
        raise
    except OSError:  # a disk without links: the name is taken first
        target.open("xb").close()
        try:
            os.replace(temporary, target)
        except OSError:
            target.unlink(missing_ok=True)
            raise
    else:
        temporary.unlink()


def _write_and_place(
    target: Path,
    temporary: Path,
    writer: Callable[[BinaryIO], object],
    place: Callable[[Path, Path], None],
) -> None:
    # Not tempfile: its files can be read by their owner only, and would stay so.
    file = temporary.open("x+b")
    try:
        with file:
            writer(file)
            file.flush()
            os.fsync(file.fileno())
        if target.is_file():
            temporary.chmod(stat.S_IMODE(target.stat().st_mode))
        place(temporary, target)
    except BaseException:
        temporary.unlink(missing_ok=True)
        raise
    sync_folder(target.parent)


def sync_folder(folder: Path) -> None:
    """Bring the names in a folder to the disk: without, a power cut takes away a new file whole."""
    if os.name != "posix":
        return  # no other system opens folders
    # Some network disks refuse this; the files' bytes are safe all the same.
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def cannot_write(error: OSError, path: Path) -> InputError:
    """Return what to raise about a file that the system does not let be written."""
    found, advice = _plain_words(error)
    return InputError(found, where=str(path), advice=advice)


def _plain_words(error: OSError) -> tuple[str, str]:
    """Return what was found and what to do about it."""
    match error.errno:
        case errno.ENOSPC | errno.EDQUOT:
            return tr("the disk is full"), tr("Free some space or choose another disk")
        case errno.EACCES | errno.EPERM:
            return tr("you have no permission to write here"), tr(
                "Choose a folder of your own, or ask for permission"
            )
        case errno.EROFS:
            return tr("this disk can only be read"), tr("Choose a folder on another disk")
        case errno.ENOENT:
            return tr("the folder does not exist"), tr("Make the folder first")
        case errno.ENOTDIR | errno.EEXIST:
            return tr("a file stands where a folder should be"), tr("Choose another folder")
        case errno.EISDIR:
            return tr("a folder stands where the file should be"), tr("Choose another name")
        case errno.ENAMETOOLONG:
            return tr("the name is too long"), tr("Choose a shorter name")
        case errno.EFBIG:
            return tr("the file is too large for this disk"), tr("Choose another disk")
    reason = error.strerror or str(error)
    return tr("the file cannot be written ({reason})").format(reason=reason), tr(
        "Check the disk or choose another folder"
    )
