"""One program at a time writes a run's folder; the others are told who does."""

from __future__ import annotations

import errno
import os
import socket
import sys
from pathlib import Path

from gelpolight_core.errors import InputError
from gelpolight_core.export.atomic import cannot_write
from gelpolight_core.translation import tr
from gelpolight_core.who import user_name

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

FILE = ".writing"
# Windows locks bytes, and lets nobody else read them: one far behind the name.
_LOCKED_BYTE = 4096


class RunLock:
    """The right to write a run's folder, until it is released or the program ends, however it does.

    Parameters
    ----------
    folder : Path
        Of the run.

    Raises
    ------
    InputError
        If another program has it, or the folder cannot be written.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        path = folder / FILE
        try:
            self._handle: int | None = os.open(path, os.O_RDWR | os.O_CREAT, 0o666)
        except OSError as error:
            raise cannot_write(error, path) from error
        try:
            # The system lets go of it with the process, even a killed one.
            _lock(self._handle)
        except OSError as error:
            who = _holder(self._handle)
            self.release()
            if error.errno not in (errno.EAGAIN, errno.EACCES):
                raise cannot_write(error, path) from error
            raise InputError(
                tr("this run is being written by {who}").format(who=who),
                where=str(folder),
                advice=tr("Leave the run there first, or begin another one"),
            ) from error
        try:
            os.ftruncate(self._handle, 0)
            os.lseek(self._handle, 0, os.SEEK_SET)
            os.write(self._handle, _name().encode())
        except OSError as error:
            self.release()
            raise cannot_write(error, path) from error

    def __enter__(self) -> RunLock:
        """Hold it for a block."""
        return self

    def __exit__(self, *_: object) -> None:
        """Let go at the block's end."""
        self.release()

    def release(self) -> None:
        """Let others write; more than once does no harm."""
        handle, self._handle = self._handle, None
        if handle is not None:
            os.close(handle)


def _lock(handle: int) -> None:
    """Take a file for this process; OSError where another one has it."""
    if sys.platform == "win32":
        os.lseek(handle, _LOCKED_BYTE, os.SEEK_SET)
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
    else:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _name() -> str:
    return f"{user_name() or tr('somebody')} @ {socket.gethostname()}, process {os.getpid()}"


def _holder(handle: int) -> str:
    """Return who wrote himself into the file."""
    os.lseek(handle, 0, os.SEEK_SET)
    return os.read(handle, 200).decode("utf-8", "replace") or tr("another program")
