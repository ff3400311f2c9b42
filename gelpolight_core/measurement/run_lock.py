"""One program at a time writes a run of the protocol; the others are told who does."""

from __future__ import annotations

import errno
import fcntl
import getpass
import os
import socket
from pathlib import Path

from gelpolight_core.errors import InputError
from gelpolight_core.measurement.ledger import unwritable
from gelpolight_core.translation import tr

FILE = ".writing"


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
            raise unwritable(error, path) from error
        try:
            # The system lets go of it with the process, even a killed one.
            fcntl.flock(self._handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            who = _holder(self._handle)
            self.release()
            if error.errno not in (errno.EAGAIN, errno.EACCES):
                raise unwritable(error, path) from error
            raise InputError(
                tr("this run is being written by {who}").format(who=who),
                where=str(folder),
                advice=tr("Leave the run there first, or begin another one"),
            ) from error
        os.ftruncate(self._handle, 0)
        os.pwrite(self._handle, _name().encode(), 0)

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


def _name() -> str:
    return f"{getpass.getuser()} @ {socket.gethostname()}, process {os.getpid()}"


def _holder(handle: int) -> str:
    """Return who wrote himself into the file."""
    return os.pread(handle, 200, 0).decode("utf-8", "replace") or tr("another program")
