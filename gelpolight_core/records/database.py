"""Open the database of the records, and set a damaged one aside."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path

from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.io.atomic import cannot_write, refuse_link
from gelpolight_core.io.reading import brief
from gelpolight_core.records.schema import bring_up_to_date

DAMAGED = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)
VALUE_LIMIT = 10_000_000
"""Largest size of one value, or one row, in bytes."""


def connect(path: Path, busy_s: float) -> sqlite3.Connection:
    """Open or create the file, update its tables and check it for damage.

    Raises
    ------
    InputError
        If it belongs to another program or to a newer version of this one, or is a link.
    sqlite3.Error
        If it cannot be opened, or is damaged.
    """
    refuse_link(path)  # SQLite would follow it
    # Any thread may use it, one at a time, controlled by the lock of the records.
    connection = sqlite3.connect(
        path, timeout=busy_s, isolation_level=None, check_same_thread=False
    )
    try:
        connection.row_factory = sqlite3.Row
        connection.execute("PRAGMA synchronous = EXTRA")
        connection.execute("PRAGMA foreign_keys = ON")
        # Code in the file's schema never runs, and no value can fill the memory.
        connection.execute("PRAGMA trusted_schema = OFF")
        connection.execute("PRAGMA cell_size_check = ON")
        connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, VALUE_LIMIT)
        bring_up_to_date(connection, path)
        (state,) = connection.execute("PRAGMA quick_check(1)").fetchone()
        if state != "ok":
            damage = sqlite3.DatabaseError(state)
            damage.sqlite_errorcode = sqlite3.SQLITE_CORRUPT
            raise damage
    except BaseException:
        connection.close()
        raise
    return connection


def keep_aside(path: Path) -> Path:
    """Rename a damaged file and its journal, and return the new name."""
    stamp = datetime.now(UTC).strftime("%Y%m%d-%H%M%S-%f")
    aside = path.with_name(f"{path.stem}.damaged-{stamp}{path.suffix}")
    try:
        path.rename(aside)
        journal = path.with_name(f"{path.name}-journal")
        if journal.exists():
            journal.rename(aside.with_name(f"{aside.name}-journal"))
    except OSError as error:
        raise cannot_write(error, path) from error
    return aside


@contextmanager
def in_plain_words(path: Path) -> Iterator[None]:
    """Raise InputError for errors of the database or the disk inside the block."""
    try:
        yield
    except (sqlite3.Error, UnicodeDecodeError) as error:
        found, advice = _plain_words(error)
        raise InputError(found, path, advice) from error


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
            return "Another program is using the records", Remedy.CLOSE_PROGRAM
        case sqlite3.SQLITE_READONLY | sqlite3.SQLITE_PERM | sqlite3.SQLITE_AUTH:
            return "The records are read-only", Remedy.ASK_PERMISSION
        case sqlite3.SQLITE_CANTOPEN:
            return "The records cannot be opened or created here", Remedy.CHECK_DISK
        case sqlite3.SQLITE_FULL:
            return "The disk is full", Remedy.FREE_SPACE
        case sqlite3.SQLITE_CORRUPT | sqlite3.SQLITE_NOTADB:
            return "The records are damaged", (
                "Restart the program: it keeps the damaged file under another name and "
                "creates a new one"
            )
    return f"The records cannot be used ({brief(str(error))})", Remedy.CHECK_DISK
