"""Open the database of the records, and set a damaged one aside."""

from __future__ import annotations

import sqlite3
from datetime import UTC, datetime
from pathlib import Path

from gelpolight_core.io.atomic import cannot_write
from gelpolight_core.records.schema import bring_up_to_date

VALUE_LIMIT = 10_000_000
"""Largest size of one value, or one row, in bytes."""


def connect(path: Path, busy_s: float) -> sqlite3.Connection:
    """Open or create the file, update its tables and check it for damage.

    Raises
    ------
    InputError
        If it belongs to another program, or to a newer version of this one.
    sqlite3.Error
        If it cannot be opened, or is damaged.
    """
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
