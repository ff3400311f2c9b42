"""Opening the database of the records, and putting a damaged one aside."""

from __future__ import annotations

import sqlite3
from datetime import UTC, datetime
from pathlib import Path

from gelpolight_core.export.atomic import cannot_write
from gelpolight_core.records.schema import bring_up_to_date

VALUE_LIMIT = 10_000_000
"""Bytes of one value, or of one row."""


def connect(path: Path, busy_s: float) -> sqlite3.Connection:
    """Open the file, or begin one; bring its tables up to date and look through it for damage.

    Raises
    ------
    InputError
        If it is another program's, or of a newer version of this one.
    sqlite3.Error
        If it cannot be opened, or is damaged.
    """
    # Any thread may use it, one at a time: the lock of the records sees to that.
    connection = sqlite3.connect(
        path, timeout=busy_s, isolation_level=None, check_same_thread=False
    )
    try:
        connection.row_factory = sqlite3.Row
        connection.execute("PRAGMA synchronous = EXTRA")
        connection.execute("PRAGMA foreign_keys = ON")
        # What the file says of itself runs nothing, and no value of it fills the memory.
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
    """Give a damaged file, and the journal that belongs to it, another name; return it."""
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
