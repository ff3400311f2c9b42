"""Hashes of captured files, and the check that no image occurs twice in a session."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path

from gelpolight_core.errors import InputError
from gelpolight_core.io.reading import open_file, unreadable
from gelpolight_core.translation import tr


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
                tr("The image is a copy of {first}").format(
                    first=f"{first.parent.name}/{first.name}"
                ),
                where=str(path),
                advice=tr("Capture this image again, or remove the copy"),
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
