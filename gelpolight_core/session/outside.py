"""Files of a session that somebody else changes while it is open."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

from gelpolight_core.errors import InputError
from gelpolight_core.reading import open_file
from gelpolight_core.translation import tr

_Mark = tuple[int, ...]


class KnownFiles:
    """What files held when they were last read or written here.

    Parameters
    ----------
    paths : sequence of Path
        The files; they need not exist.
    """

    def __init__(self, paths: Sequence[Path]) -> None:
        self._known = {path: (_mark(path), _digest(path)) for path in paths}

    def changed(self) -> tuple[Path, ...]:
        """Return the files that hold something else now, or are gone."""
        return tuple(path for path in self._known if self._is_changed(path))

    def take(self, path: Path) -> None:
        """Take what a file holds now as known."""
        self._known[path] = _mark(path), _digest(path)

    def refuse_changed(self, path: Path, *, advice: str = "") -> None:
        """Refuse to write over what somebody else has put into a file.

        Parameters
        ----------
        path : Path
            The file.
        advice : str, optional
            What to do then, where it is no session's.

        Raises
        ------
        InputError
            If it was changed or removed.
        """
        if self._is_changed(path):
            raise InputError(
                tr("the file was changed by something else since it was read; nothing was written"),
                where=str(path),
                advice=advice or tr("Reload the session, then correct it again"),
            )

    def _is_changed(self, path: Path) -> bool:
        mark, digest = self._known[path]
        now = _mark(path)
        if now == mark:
            return False
        if _digest(path) != digest:
            return True
        self._known[path] = now, digest
        return False


def _mark(path: Path) -> _Mark | None:
    """Return what changes with a file, and costs less to look at than what it holds.

    Its times alone do not tell: clocks are set back, and some disks count in steps of two seconds.
    """
    try:
        stat = path.stat()
    except OSError:
        return None
    return stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns, stat.st_ino


def _digest(path: Path) -> bytes | None:
    """Return a hash of what a file holds; None where there is no file that can be read."""
    try:
        with open_file(path) as stream:
            return hashlib.file_digest(stream, "sha256").digest()
    except (OSError, InputError):
        return None
