"""Hashes of files, by which changes of other programs are noticed."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path

from gelpolight_core.base.errors import InputError, Remedy
from gelpolight_core.base.safe_reading import cannot_read, open_file


def file_hash(path: Path) -> str:
    """Return the SHA-256 of a file as hexadecimal text.

    Raises
    ------
    InputError
        If it cannot be read or is not an ordinary file.
    """
    try:
        with open_file(path) as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise cannot_read(error, path) from error


class FileSnapshots:
    """The content of small files when they were last read or written here.

    Parameters
    ----------
    paths : sequence of Path
        The files; they need not exist.
    """

    def __init__(self, paths: Iterable[Path]) -> None:
        self._known = {path: _hash_or_none(path) for path in paths}

    def take(self, path: Path) -> None:
        """Record the present content of a file as known."""
        self._known[path] = _hash_or_none(path)

    def refuse_changed(self, path: Path) -> None:
        """Refuse to overwrite a file that another program has changed.

        Parameters
        ----------
        path : Path
            The file.

        Raises
        ------
        InputError
            If the file was changed or removed.
        """
        if _hash_or_none(path) != self._known[path]:
            text = "Another program has changed the file since it was read; nothing was written"
            raise InputError(text, path, Remedy.REPEAT_CHANGE)


def _hash_or_none(path: Path) -> str | None:
    """Return the hash of a file, or None if it cannot be read."""
    try:
        return file_hash(path)
    except InputError:
        return None
