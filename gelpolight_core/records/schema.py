"""The tables of the records, version by version."""

from __future__ import annotations

import sqlite3
from pathlib import Path

from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.io.reading import refuse_newer

# "GPLR": distinguishes our databases from those of other programs.
APPLICATION_ID = 0x47504C52

_FIRST = (
    """CREATE TABLE sensors (
        serial TEXT PRIMARY KEY,
        first_seen TEXT NOT NULL
    )""",
    """CREATE TABLE calibrations (
        id TEXT PRIMARY KEY,
        serial TEXT NOT NULL REFERENCES sensors (serial),
        first_seen TEXT NOT NULL,
        model TEXT NOT NULL DEFAULT '',
        made TEXT NOT NULL DEFAULT '',
        verdict TEXT NOT NULL DEFAULT ''
    )""",
    """CREATE TABLE measurements (
        id INTEGER PRIMARY KEY AUTOINCREMENT,
        time TEXT NOT NULL,
        serial TEXT NOT NULL REFERENCES sensors (serial),
        calibration_id TEXT REFERENCES calibrations (id),
        shape TEXT NOT NULL,
        verdict TEXT NOT NULL,
        reason TEXT NOT NULL,
        settings TEXT NOT NULL,
        details TEXT NOT NULL,
        operator TEXT NOT NULL,
        picture TEXT NOT NULL,
        note TEXT NOT NULL,
        removed TEXT
    )""",
    """CREATE TABLE quantities (
        measurement_id INTEGER NOT NULL REFERENCES measurements (id),
        position INTEGER NOT NULL,
        name TEXT NOT NULL,
        value REAL NOT NULL,
        sd REAL,
        truth REAL,
        error REAL,
        error_percent REAL,
        limit_percent REAL,
        PRIMARY KEY (measurement_id, name)
    )""",
    "CREATE INDEX measurements_by_sensor ON measurements (serial, time)",
)

_REFERENCE = ("ALTER TABLE quantities ADD COLUMN truth_sd REAL",)

MIGRATIONS: tuple[tuple[str, ...], ...] = (_FIRST, _REFERENCE)
"""Statements that migrate each version to the next, starting from an empty file."""


def bring_up_to_date(connection: sqlite3.Connection, path: Path) -> None:
    """Create the tables, or migrate older ones to the present version, completely or not at all.

    Raises
    ------
    InputError
        If the database belongs to another program, or to a newer version of this one.
    sqlite3.Error
        If it cannot be read or written.
    """
    if _version(connection, path) == len(MIGRATIONS):
        refuse_other_tables(connection, path)
        return
    connection.execute("BEGIN IMMEDIATE")
    try:
        # Another program may have migrated it while we waited for our turn.
        for number in range(_version(connection, path), len(MIGRATIONS)):
            for statement in MIGRATIONS[number]:
                connection.execute(statement)
        connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
        connection.execute(f"PRAGMA user_version = {len(MIGRATIONS)}")
        connection.execute("COMMIT")
    except BaseException:
        connection.rollback()
        raise


def refuse_other_tables(connection: sqlite3.Connection, path: Path) -> None:
    """Refuse views, triggers and tables of other programs: they might run for ever.

    Raises
    ------
    InputError
        If there are any, or one of our tables is missing or different.
    """
    own = sqlite3.connect(":memory:")
    try:
        for statements in MIGRATIONS:
            for statement in statements:
                own.execute(statement)
        wanted = _tables(own)
    finally:
        own.close()
    if _tables(connection) != wanted:
        raise InputError(
            "The records contain other tables than those of this program",
            path,
            Remedy.REPAIR_FILE,
        )


def _tables(connection: sqlite3.Connection) -> set[tuple[object, ...]]:
    rows = connection.execute("SELECT type, name, sql FROM sqlite_master").fetchall()
    # Internal tables of SQLite: its own indices, last numbers, statistics.
    return {(r[0], r[1], r[2]) for r in rows if not str(r[1]).startswith("sqlite_")}


def _version(connection: sqlite3.Connection, path: Path) -> int:
    """Return the version of the tables, 0 if there are none."""
    (owner,) = connection.execute("PRAGMA application_id").fetchone()
    (tables,) = connection.execute("SELECT count(*) FROM sqlite_master").fetchone()
    (version,) = connection.execute("PRAGMA user_version").fetchone()
    if tables and owner != APPLICATION_ID:
        raise InputError("The file is a database of another program", path, Remedy.CHOOSE_FOLDER)
    refuse_newer(version, len(MIGRATIONS), path)
    return int(version) if tables else 0
