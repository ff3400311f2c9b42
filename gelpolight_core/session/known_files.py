"""Detect files of an open session that another program has changed."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path

from gelpolight_core.errors import InputError
from gelpolight_core.io.reading import open_file
from gelpolight_core.translation import tr

_Mark = tuple[int, ...]


class KnownFiles:
    """The content of files when they were last read or written here.

    Parameters
    ----------
    paths : sequence of Path
        The files; they need not exist.
    """

    def __init__(self, paths: Sequence[Path]) -> None:
        self._known = {path: (_mark(path), _digest(path)) for path in paths}

    def changed(self) -> tuple[Path, ...]:
        """Return the files that have changed or are gone."""
        return tuple(path for path in self._known if self._is_changed(path))

    def take(self, path: Path) -> None:
        """Record the present content of a file as known."""
        self._known[path] = _mark(path), _digest(path)

    def refuse_changed(self, path: Path, *, advice: str = "") -> None:
        """Refuse to overwrite a file that another program has changed.

        Parameters
        ----------
        path : Path
            The file.
        advice : str, optional
            Advice for a file that does not belong to a session.

        Raises
        ------
        InputError
            If the file was changed or removed.
        """
        if self._is_changed(path):
            raise InputError(
                tr("Another program has changed the file since it was read; nothing was written"),
                where=str(path),
                advice=advice or tr("Reload the session and repeat your correction"),
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
    """Return a value that changes with the file and is cheaper to get than its content.

    File times alone are not enough: clocks are set back, and some disks store times in steps of two
    seconds.
    """
    try:
        stat = path.stat()
    except OSError:
        return None
    return stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns, stat.st_ino


def _digest(path: Path) -> bytes | None:
    """Return a hash of the content of a file; None if there is no readable file."""
    try:
        with open_file(path) as stream:
            return hashlib.file_digest(stream, "sha256").digest()
    except (OSError, InputError):
        return None
