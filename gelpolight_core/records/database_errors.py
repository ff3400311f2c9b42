"""Database errors in plain words."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from gelpolight_core.errors import InputError
from gelpolight_core.io.reading import brief
from gelpolight_core.translation import tr

DAMAGED = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)


@contextmanager
def in_plain_words(path: Path) -> Iterator[None]:
    """Raise InputError for errors of the database or the disk inside the block."""
    try:
        yield
    except (sqlite3.Error, UnicodeDecodeError) as error:
        found, advice = _plain_words(error)
        raise InputError(found, where=str(path), advice=advice) from error


def is_damage(error: sqlite3.Error | UnicodeDecodeError) -> bool:
    """Return whether an error means that the file itself is damaged."""
    return _code(error) in DAMAGED


def _code(error: sqlite3.Error | UnicodeDecodeError) -> int:
    if isinstance(error, UnicodeDecodeError):
        return sqlite3.SQLITE_CORRUPT  # damaged so badly that no code can be read
    # The lower byte is the error type; the upper bytes are details.
    return int(getattr(error, "sqlite_errorcode", sqlite3.SQLITE_ERROR)) & 0xFF


def _plain_words(error: sqlite3.Error | UnicodeDecodeError) -> tuple[str, str]:
    match _code(error):
        case sqlite3.SQLITE_BUSY | sqlite3.SQLITE_LOCKED:
            return tr("Another program is using the records"), tr(
                "Wait until it has finished, or close it, and try again"
            )
        case sqlite3.SQLITE_READONLY | sqlite3.SQLITE_PERM | sqlite3.SQLITE_AUTH:
            return tr("The records are read-only"), tr(
                "Ask for write permission for this folder, or choose another workspace"
            )
        case sqlite3.SQLITE_CANTOPEN:
            return tr("The records cannot be opened or created here"), tr(
                "Check that the folder exists and that you have write permission"
            )
        case sqlite3.SQLITE_FULL:
            return tr("The disk is full"), tr("Free some space and try again")
        case sqlite3.SQLITE_CORRUPT | sqlite3.SQLITE_NOTADB:
            return tr("The records are damaged"), tr(
                "Restart the program: it keeps the damaged file under another name and "
                "creates a new one"
            )
    return tr("The records cannot be used ({reason})").format(reason=brief(str(error))), tr(
        "Check the disk, and try again"
    )
