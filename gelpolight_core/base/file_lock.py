"""Locks: one program at a time writes to a run's folder or uses a camera."""

from __future__ import annotations

import errno
import os
import socket
import sys
from collections.abc import Callable
from pathlib import Path

from .atomic_write import cannot_write, open_unlinked
from .errors import InputError, Remedy
from .user_name import user_name

if sys.platform == "win32":
    import msvcrt
else:
    import fcntl

FILE = ".writing"
# Windows locks byte ranges and prevents others from reading them: lock one far behind the name.
_LOCKED_BYTE = 4096


class FileLock:
    """A lock that others respect, until it is released or the program ends in any way.

    Parameters
    ----------
    path : Path
        File that is locked, and that names its holder.
    refusal : callable
        Returns the error for a holder: user, computer and process.

    Raises
    ------
    InputError
        If another program has the lock, or the file cannot be written.
    """

    def __init__(self, path: Path, refusal: Callable[[str], InputError]) -> None:
        self._handle: int | None = open_unlinked(path, os.O_RDWR)
        try:
            # The system releases the lock with the process, even if it is killed.
            _lock(self._handle)
        except OSError as error:
            holder = _holder(self._handle)
            self.release()
            if error.errno not in (errno.EAGAIN, errno.EACCES):
                raise cannot_write(error, path) from error
            raise refusal(holder) from error
        try:
            os.ftruncate(self._handle, 0)
            os.lseek(self._handle, 0, os.SEEK_SET)
            os.write(self._handle, _name().encode())
        except OSError as error:
            self.release()
            raise cannot_write(error, path) from error

    def __enter__(self) -> FileLock:
        """Hold the lock for a block."""
        return self

    def __exit__(self, *_: object) -> None:
        """Release the lock at the end of the block."""
        self.release()

    def release(self) -> None:
        """Release the lock, also repeatedly."""
        handle, self._handle = self._handle, None
        if handle is not None:
            os.close(handle)


class RunLock(FileLock):
    """The lock on a run's folder.

    Parameters
    ----------
    folder : Path
        Folder of the run.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        super().__init__(folder / FILE, self._refusal)

    def _refusal(self, holder: str) -> InputError:
        text = f"This run is being written by {holder}"
        return InputError(text, self.folder, Remedy.STOP_OTHER)


def _lock(handle: int) -> None:
    """Lock a file for this process, with OSError if another process has the lock."""
    if sys.platform == "win32":
        os.lseek(handle, _LOCKED_BYTE, os.SEEK_SET)
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
    else:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _name() -> str:
    return f"{user_name() or 'unknown user'} @ {socket.gethostname()}, process {os.getpid()}"


def _holder(handle: int) -> str:
    """Return the name written to the file by the holder of the lock."""
    os.lseek(handle, 0, os.SEEK_SET)
    return os.read(handle, 200).decode("utf-8", "replace") or "another program"
