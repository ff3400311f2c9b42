"""What a database refuses, in plain words."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gelpolight_core.errors import InputError
from gelpolight_core.reading import brief
from gelpolight_core.translation import tr

DAMAGED = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)


@contextmanager
def in_plain_words(path: Path) -> Iterator[None]:
    """Raise InputError for what the database or the disk refuses inside of the block."""
    try:
        yield
    except (sqlite3.Error, UnicodeDecodeError) as error:
        found, advice = _plain_words(error)
        raise InputError(found, where=str(path), advice=advice) from error


def is_damage(error: sqlite3.Error | UnicodeDecodeError) -> bool:
    """Return whether an error says that the file itself is spoilt."""
    return _code(error) in DAMAGED


def _code(error: sqlite3.Error | UnicodeDecodeError) -> int:
    if isinstance(error, UnicodeDecodeError):
        return sqlite3.SQLITE_CORRUPT  # so much so that it cannot even be told
    # The lower byte is the kind; what stands above it is a detail.
    return int(getattr(error, "sqlite_errorcode", sqlite3.SQLITE_ERROR)) & 0xFF


def _plain_words(error: sqlite3.Error | UnicodeDecodeError) -> tuple[str, str]:
    match _code(error):
        case sqlite3.SQLITE_BUSY | sqlite3.SQLITE_LOCKED:
            return tr("another program is holding the records"), tr(
                "Wait until it is done, or close it, and try again"
            )
        case sqlite3.SQLITE_READONLY | sqlite3.SQLITE_PERM | sqlite3.SQLITE_AUTH:
            return tr("the records can only be read here"), tr(
                "Ask for permission to write into this folder, or choose another workspace"
            )
        case sqlite3.SQLITE_CANTOPEN:
            return tr("the records cannot be opened or made here"), tr(
                "Check that the folder is there and that you may write into it"
            )
        case sqlite3.SQLITE_FULL:
            return tr("the disk is full"), tr("Free some space and try again")
        case sqlite3.SQLITE_CORRUPT | sqlite3.SQLITE_NOTADB:
            return tr("the records are damaged"), tr(
                "Start the program again: it keeps the damaged file aside and begins a new one"
            )
    return tr("the records cannot be used ({reason})").format(reason=brief(str(error))), tr(
        "Check the disk, and try again"
    )
