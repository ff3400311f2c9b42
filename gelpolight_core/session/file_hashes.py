"""Hashes of files: images that occur twice, and files that another program has changed."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path

from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.io.reading import open_file, unreadable


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
        raise unreadable(error, path) from error


def refuse_copies(files: Iterable[Path]) -> None:
    """Refuse an image that occurs twice in a session: noise makes any two captures differ.

    A copied image means that a stage was not captured, such as the background copied to the
    whiteboard. No later figure would show this.

    Raises
    ------
    InputError
        If two of the files have the same content.
    """
    seen: dict[str, Path] = {}
    for path in files:
        first = seen.setdefault(file_hash(path), path)
        if first is not path:
            raise InputError(
                "The image is a copy of {first}".format(first=f"{first.parent.name}/{first.name}"),
                path,
                Remedy.CAPTURE_AGAIN,
            )


class CachedHashes:
    """Hashes of files, recomputed only when a file's size or time has changed."""

    def __init__(self) -> None:
        self._known: dict[Path, tuple[tuple[int, int], str]] = {}

    def __call__(self, path: Path) -> str:
        """Return the hash of a file."""
        stat = path.stat()
        mark = stat.st_size, stat.st_mtime_ns
        known = self._known.get(path)
        if known is None or known[0] != mark:
            known = self._known[path] = mark, file_hash(path)
        return known[1]


class KnownFiles:
    """The content of small files when they were last read or written here.

    Parameters
    ----------
    paths : sequence of Path
        The files; they need not exist.
    """

    def __init__(self, paths: Iterable[Path]) -> None:
        self._known = {path: _hash_or_none(path) for path in paths}

    def changed(self) -> tuple[Path, ...]:
        """Return the files that have changed or are gone."""
        return tuple(path for path, known in self._known.items() if _hash_or_none(path) != known)

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
        if path in self.changed():
            raise InputError(
                "Another program has changed the file since it was read; nothing was written",
                path,
                Remedy.REPEAT_CHANGE,
            )


def _hash_or_none(path: Path) -> str | None:
    """Return the hash of a file; None if there is no readable file."""
    try:
        return file_hash(path)
    except InputError:
        return None
