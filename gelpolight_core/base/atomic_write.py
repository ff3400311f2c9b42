"""Write files completely or not at all."""

from __future__ import annotations

import contextlib
import errno
import json
import os
import secrets
import stat
from collections.abc import Callable, Mapping, Sequence
from operator import methodcaller
from pathlib import Path
from typing import Any, BinaryIO

from .errors import InputError, Remedy


class NameTakenError(InputError):
    """A new file cannot be written because a file with its name exists."""


def write_atomically(
    path: Path,
    writer: Callable[[BinaryIO], object],
    *,
    new: bool = False,
    inside: Path | None = None,
) -> None:
    """Write a file so that other programs see either the complete old file or the complete new one.

    The bytes are written to a temporary file in the same folder, flushed to disk, and then replace
    the old file in one step. If anything fails, including Ctrl-C, the old file stays unchanged and
    the temporary one is removed. A symbolic link is followed, but replaced in a folder that others
    can write to; the permissions of an existing file are kept.

    Parameters
    ----------
    path : Path
        Destination; its folder must exist.
    writer : callable
        Receives the open binary file (which can seek) and writes into it.
    new : bool, optional
        Whether an existing file is never replaced, not even one written by another program at the
        same moment.
    inside : Path, optional
        A folder that may come from elsewhere: links in it that point outside are not followed.

    Raises
    ------
    NameTakenError
        If `new` is set and the file exists.
    InputError
        If the file cannot be written: folder missing, no permission, disk full.
    """
    target = _ordinary_target(path)
    if inside is not None and not target.is_relative_to(os.path.realpath(inside)):
        text = "The path is a link that points outside the folder"
        raise InputError(text, path, Remedy.REPLACE_LINK)
    try:
        _write_and_place(target, _temporary_for(target), writer, _place_new if new else os.replace)
    except FileExistsError as error:
        if not new:
            raise cannot_write(error, path) from error
        text = "A file with this name already exists"
        raise NameTakenError(text, path, Remedy.CHOOSE_NAME) from error
    except OSError as error:
        raise cannot_write(error, path) from error


def write_text(path: Path, text: str, *, inside: Path | None = None) -> None:
    """Write a text in UTF-8, as :func:`write_atomically`."""
    write_atomically(path, lambda file: file.write(text.encode()), inside=inside)


def write_json(path: Path, content: Mapping[str, Any] | Sequence[Any]) -> None:
    """Write a JSON file, as :func:`write_atomically`."""
    write_text(path, json.dumps(content, indent=1, allow_nan=False) + "\n")


def write_files(folder: Path, contents: Mapping[str, bytes]) -> tuple[Path, ...]:
    """Write files by their names into a folder, each as :func:`write_atomically`."""
    for name, content in contents.items():
        write_atomically(folder / name, methodcaller("write", content))
    return tuple(folder / name for name in contents)


def refuse_unwritable(path: Path) -> None:
    """Refuse a file that cannot be written, before its content is computed.

    Raises
    ------
    InputError
        As for :func:`write_atomically`, except for a full disk.
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
    """Create a folder with its parents, unless it exists.

    Raises
    ------
    InputError
        If it cannot be created, or a file has its name.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise cannot_write(error, folder) from error


def _ordinary_target(path: Path) -> Path:
    """Return the target of a path, which must be an ordinary file."""
    target = Path(os.path.realpath(path))
    folder = Path(os.path.realpath(path.parent))
    if path.is_symlink() and folder.stat().st_mode & (stat.S_IWGRP | stat.S_IWOTH):
        return folder / path.name  # the link may be of somebody else
    if target.exists() and not (target.is_file() or target.is_dir()):
        # Otherwise an ordinary file would replace, for example, /dev/full.
        raise InputError("The path is a device, not a file", path, Remedy.CHOOSE_FILE)
    return target


def _temporary_for(target: Path) -> Path:
    return target.with_name(f".{target.name[:200]}.{secrets.token_hex(4)}.part")


def _place_new(temporary: Path, target: Path) -> None:
    """Give a file its name, unless another file has it."""
    try:
        os.link(temporary, target)
    except FileExistsError:
        raise
    except OSError:  # a file system without links: the name is reserved first
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
    # Not tempfile: its files are readable only by their owner, and would stay so.
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
    """Flush the names in a folder to disk: otherwise a power cut can remove a complete new file."""
    if os.name != "posix":
        return  # no other system opens folders
    # Some network disks refuse this; the content of the files is safe anyway.
    with contextlib.suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def cannot_write(error: OSError, path: Path) -> InputError:
    """Return the error for a file that the system does not allow to be written."""
    text, advice = _plain_words(error)
    return InputError(text, path, advice)


def _plain_words(error: OSError) -> tuple[str, str]:
    """Return the problem and the advice."""
    match error.errno:
        case errno.ENOSPC | errno.EDQUOT:
            return "The disk is full", Remedy.FREE_SPACE
        case errno.EACCES | errno.EPERM:
            return "You do not have permission to write here", Remedy.ASK_PERMISSION
        case errno.EROFS:
            return "This disk is read-only", Remedy.CHOOSE_FOLDER
        case errno.ENOENT:
            return "The folder does not exist", Remedy.CHECK_NAME
        case errno.ENOTDIR | errno.EEXIST:
            return "A file has the name of a required folder", Remedy.CHOOSE_FOLDER
        case errno.EISDIR:
            return "A folder has the name of the file", Remedy.CHOOSE_NAME
        case errno.ENAMETOOLONG:
            return "The name is too long", Remedy.CHOOSE_NAME
        case errno.EFBIG:
            return "The file is too large for this disk", Remedy.FREE_SPACE
    reason = error.strerror or str(error)
    return f"The file cannot be written ({reason})", Remedy.CHECK_DISK


def append_with_fsync(path: Path, content: bytes) -> None:
    """Append whole lines to a file, created if it does not exist, and flush them to disk.

    If the disk refuses them, the file keeps its old end as far as possible. A line that a crash cut
    off is ended first.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    try:
        is_new = not path.exists()
        # Unbuffered: data left in a buffer would be written again when the file is closed.
        handle = open_unlinked(path, os.O_RDWR | os.O_APPEND)
        with os.fdopen(handle, "a+b", buffering=0) as file:
            size = os.fstat(file.fileno()).st_size
            file.seek(max(size - 1, 0))
            if size and file.read(1) != b"\n":
                content = b"\n" + content
            try:
                _write_all(file.fileno(), content)
            except OSError:
                with contextlib.suppress(OSError):  # the first refusal is reported
                    os.ftruncate(file.fileno(), size)
                raise
    except OSError as error:
        raise cannot_write(error, path) from error
    if is_new:
        sync_folder(path.parent)


def open_unlinked(path: Path, flags: int) -> int:
    """Return the handle of a file of this program, open to write and created if needed.

    Others may write to its folder: a link placed there would redirect what is written.

    Raises
    ------
    InputError
        If it is a link or no file, or cannot be written.
    """
    flags |= os.O_CREAT | getattr(os, "O_CLOEXEC", 0) | getattr(os, "O_BINARY", 0)
    try:
        handle = os.open(path, flags | getattr(os, "O_NOFOLLOW", 0), 0o666)
    except OSError as error:
        raise (_is_link(path) if path.is_symlink() else cannot_write(error, path)) from error
    status = os.fstat(handle)
    if status.st_nlink > 1 or not stat.S_ISREG(status.st_mode):
        os.close(handle)
        raise _is_link(path)
    return handle


def refuse_link(path: Path) -> None:
    """Refuse a link in place of a file of this program, which a library opens by its name.

    Not by opening it as well: with a second handle, a process loses its locks on the file.

    Raises
    ------
    InputError
        If it is a link, or has another name.
    """
    if path.is_symlink() or (path.exists() and path.stat().st_nlink > 1):
        raise _is_link(path)


def _is_link(path: Path) -> InputError:
    text = "This file is a link to another file, which would be overwritten"
    return InputError(text, path, Remedy.REPLACE_LINK)


def _write_all(handle: int, content: bytes) -> None:
    view = memoryview(content)
    while view:
        view = view[os.write(handle, view) :]
    os.fsync(handle)
