"""Hashes of captured files: which they were, and whether one stands in a session twice."""

from __future__ import annotations

import hashlib
from collections.abc import Iterable
from pathlib import Path

from gelpolight_core.errors import InputError
from gelpolight_core.reading import open_file, unreadable
from gelpolight_core.translation import tr


def file_hash(path: Path) -> str:
    """Return the SHA-256 of a file as hexadecimal text.

    Raises
    ------
    InputError
        If it cannot be read, or is no ordinary file.
    """
    try:
        with open_file(path) as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except OSError as error:
        raise unreadable(error, path) from error


def refuse_copies(files: Iterable[Path]) -> None:
    """Refuse a picture that stands in a session twice: noise makes any two captures differ.

    A copied picture is a stage that was not captured, such as the background in the place of the
    whiteboard, which no later figure shows.

    Raises
    ------
    InputError
        If two of the files hold the same bytes.
    """
    seen: dict[str, Path] = {}
    for path in files:
        first = seen.setdefault(file_hash(path), path)
        if first is not path:
            raise InputError(
                tr("the picture is a copy of {first}").format(
                    first=f"{first.parent.name}/{first.name}"
                ),
                where=str(path),
                advice=tr("Capture this picture itself, or remove the copy"),
            )


class RememberedHashes:
    """Hashes of files, made anew only when a file's size or time has changed."""

    def __init__(self) -> None:
        self._known: dict[Path, tuple[tuple[int, int], str]] = {}

    def __call__(self, path: Path) -> str:
        """Return a file's hash."""
        stat = path.stat()
        mark = stat.st_size, stat.st_mtime_ns
        known = self._known.get(path)
        if known is None or known[0] != mark:
            known = self._known[path] = mark, file_hash(path)
        return known[1]
