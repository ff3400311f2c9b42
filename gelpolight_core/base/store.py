"""Store of a lab's records: one SQLite file with a row for each entry.

A row has a number, a time, a kind, and its value as JSON by the codec. Every change is one
transaction that is on disk before the call returns (rollback journal, ``synchronous = EXTRA``), so
that neither a killed program nor a power cut can lose or split a confirmed change. The write-ahead
log is not used, because it does not work on network disks. Several programs may use the file at
the same time: each waits a few seconds for its turn. Nothing is ever deleted; a removed entry is
only marked and can be restored.
"""

from __future__ import annotations

import json
import sqlite3
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, ClassVar, TypeVar

from .atomic_write import refuse_link, write_atomically
from .closable import Closable
from .codec import pack, time_text, unpack
from .errors import InputError, Remedy
from .safe_reading import invalid_file_guard, parse_json, refuse_newer, short_repr

# "GPLR": distinguishes our files from those of other programs.
APPLICATION_ID = 0x47504C52
TABLE_SINCE = 3
"""The first version that has the table of entries."""
VERSION = 3
"""A new field of an entry raises it, so that older programs refuse the file."""
BUSY_S = 5.0
"""Longest time to wait for another program."""
ROW_LIMIT = 10_000_000
"""Largest size of a row, in bytes: no damaged file can fill the memory."""

_TABLE = """CREATE TABLE entries (
    id INTEGER PRIMARY KEY AUTOINCREMENT,
    time TEXT NOT NULL,
    kind TEXT NOT NULL,
    value TEXT NOT NULL,
    removed TEXT
)"""
# Code in the file's schema never runs.
_SETTINGS = "PRAGMA synchronous = EXTRA; PRAGMA trusted_schema = OFF; PRAGMA cell_size_check = ON"
_INSERT = "INSERT INTO entries (id, time, kind, value, removed) VALUES (?, ?, ?, ?, ?)"
_INVALID = "The records contain an invalid entry ({error})"
_DAMAGED = "The records are damaged", Remedy.REPAIR_FILE
_FAULTS = {
    sqlite3.SQLITE_BUSY: ("Another program is using the records", Remedy.CLOSE_PROGRAM),
    sqlite3.SQLITE_READONLY: ("The records are read-only", Remedy.ASK_PERMISSION),
    sqlite3.SQLITE_CANTOPEN: ("The records cannot be opened or created", Remedy.CHECK_DISK),
    sqlite3.SQLITE_FULL: ("The disk is full", Remedy.FREE_SPACE),
    sqlite3.SQLITE_CORRUPT: _DAMAGED,
    sqlite3.SQLITE_NOTADB: _DAMAGED,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """Base class of what can be stored, to which each kind adds fields.

    Attributes
    ----------
    kind : str
        Name of the class's rows in the file.
    time : datetime
        With its zone.
    id : int or None
        Number in the store; None before it is stored.
    """

    kind: ClassVar[str]
    time: datetime = field(default_factory=lambda: datetime.now(UTC))
    id: int | None = None


E = TypeVar("E", bound=Entry)
Earlier = Callable[[sqlite3.Connection], Sequence[tuple[Entry, str | None]]]
"""Takes the entries out of an older file, and drops its tables; each with the time of removal."""


class Store(Closable):
    """An open file of entries, for any thread.

    Parameters
    ----------
    path : Path
        The file. It is created if it does not exist; its folder must.
    earlier : callable
        Reads files of earlier versions. They are kept aside, and their entries are moved over.

    Raises
    ------
    InputError
        If it cannot be opened or created, is damaged, belongs to another program or a newer version
        of this one, or is used by another program all the time.
    """

    def __init__(self, path: Path, earlier: Earlier) -> None:
        self.path = path
        self._lock = threading.RLock()
        refuse_link(path)  # SQLite would follow it
        with self._using():
            self._connection = sqlite3.connect(
                path, timeout=BUSY_S, isolation_level=None, check_same_thread=False
            )
        try:
            with self._using():
                self._check()
                if self._version() < VERSION:
                    self._bring_up_to_date(earlier)
        except BaseException:
            self.close()
            raise

    def add(self, entry: Entry) -> int:
        """Store an entry on disk and return its number.

        Raises
        ------
        InputError
            If it cannot be written; then no part of it is stored.
        """
        row = self._row(entry)
        with self._using():
            number = self._connection.execute(_INSERT, (None, *row, None)).lastrowid
        assert number is not None
        return number

    def all(self, kind: type[E], **fields: str | None) -> tuple[E, ...]:
        """Return entries that are not removed, in the order in which they were stored.

        Parameters
        ----------
        kind : type
            Class of the entries.
        **fields : str or None
            Only those with these values; None for any.

        Raises
        ------
        InputError
            If they cannot be read.
        """
        rows = self._select("id, time, value", kind, fields)
        with invalid_file_guard(_INVALID, self.path):
            return tuple(
                unpack(kind, {**parse_json(value), "time": time, "id": number}, {}, kind.kind)
                for number, time, value in rows
            )

    def count(self, kind: type[E], **fields: str | None) -> tuple[int, datetime | None]:
        """Return the number of entries with the time of the last one, as :meth:`all`."""
        ((number, last),) = self._select("COUNT(*), MAX(time)", kind, fields)
        return number, None if last is None else datetime.fromisoformat(last)

    def _select(
        self, what: str, kind: type[E], fields: Mapping[str, str | None]
    ) -> list[tuple[Any, ...]]:
        filters = {name: value for name, value in fields.items() if value is not None}
        conditions = "".join(f" AND json_extract(value, '$.{name}') = ?" for name in filters)
        query = (
            f"SELECT {what} FROM entries WHERE kind = ? AND removed IS NULL{conditions} ORDER BY id"
        )
        with self._using():
            return self._connection.execute(query, (kind.kind, *filters.values())).fetchall()

    def change(self, entry: Entry) -> None:
        """Replace the entry that has its number, except its time.

        Raises
        ------
        InputError
            If there is none, or it cannot be written.
        """
        _, _, value = self._row(entry)
        self._update("value", [(value, entry.id)])

    def remove(self, *numbers: int) -> None:
        """Mark entries as removed, all or none, until :meth:`restore`.

        Raises
        ------
        InputError
            If there is no such entry, or it cannot be written.
        """
        now = time_text(datetime.now(UTC))
        self._update("removed", [(now, number) for number in numbers])

    def restore(self, *numbers: int) -> None:
        """Restore removed entries, all or none, and leave the others.

        Raises
        ------
        InputError
            If there is no such entry, or it cannot be written.
        """
        self._update("removed", [(None, number) for number in numbers])

    def close(self) -> None:
        """Close the file, also repeatedly."""
        with self._lock:
            self._connection.close()

    def _check(self) -> None:
        self._connection.executescript(_SETTINGS)
        self._connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, ROW_LIMIT)
        (state,) = self._connection.execute("PRAGMA quick_check(1)").fetchone()
        if state != "ok":
            raise InputError(_DAMAGED[0], self.path, _DAMAGED[1])

    def _version(self) -> int:
        """Return the version of the file, 0 if it is empty."""
        types = {row[0] for row in self._connection.execute("SELECT type FROM sqlite_master")}
        (owner,) = self._connection.execute("PRAGMA application_id").fetchone()
        (version,) = self._connection.execute("PRAGMA user_version").fetchone()
        if types and (owner != APPLICATION_ID or version < 1):
            text = "The file is a database of another program"
            raise InputError(text, self.path, Remedy.CHOOSE_FOLDER)
        if types & {"view", "trigger"}:  # they might run for ever
            text = "The records contain more than the tables of this program"
            raise InputError(text, self.path, Remedy.REPAIR_FILE)
        refuse_newer(version, VERSION, self.path)
        return int(version) if types else 0

    def _bring_up_to_date(self, earlier: Earlier) -> None:
        with self._changing() as connection:
            # Another program may have done it while we waited for our turn.
            if (version := self._version()) == VERSION:
                return
            entries: Sequence[tuple[Entry, str | None]] = ()
            if 0 < version < TABLE_SINCE:
                aside = f"{self.path.stem}.version-{version}{self.path.suffix}"
                content = connection.serialize()
                write_atomically(self.path.with_name(aside), lambda file: file.write(content))
                with invalid_file_guard(_INVALID, self.path):
                    entries = earlier(connection)
            if version < TABLE_SINCE:
                connection.execute(_TABLE)
            for entry, removed in entries:
                connection.execute(_INSERT, (entry.id, *self._row(entry), removed))
            connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
            connection.execute(f"PRAGMA user_version = {VERSION}")

    def _row(self, entry: Entry) -> tuple[str, str, str]:
        """Return time, kind and value of an entry that can be read back."""
        with invalid_file_guard(_INVALID, self.path):
            plain = pack(entry, {}, entry.kind)
            unpack(type(entry), plain, {}, entry.kind)
            plain.pop("id", None)
            return plain.pop("time"), entry.kind, json.dumps(plain, allow_nan=False)

    def _update(self, column: str, rows: Sequence[tuple[str | None, int | None]]) -> None:
        with self._changing() as connection:
            statement = f"UPDATE entries SET {column} = ? WHERE id = ?"
            if connection.executemany(statement, rows).rowcount != len(rows):
                numbers = ", ".join(str(number) for _, number in rows)
                text = f"There is no record with the number {numbers}"
                raise InputError(text, self.path, Remedy.OPEN_AGAIN)

    @contextmanager
    def _changing(self) -> Iterator[sqlite3.Connection]:
        """Make changes completely or not at all."""
        with self._using():
            self._connection.execute("BEGIN IMMEDIATE")
            try:
                yield self._connection
                self._connection.execute("COMMIT")
            except BaseException:
                self._connection.rollback()
                raise

    @contextmanager
    def _using(self) -> Iterator[None]:
        """Let one thread at a time use the file, with faults of file and disk as a sentence."""
        try:
            with self._lock:
                yield
        except UnicodeDecodeError as error:  # damaged so badly that its message is no text
            raise InputError(_DAMAGED[0], self.path, _DAMAGED[1]) from error
        except sqlite3.Error as error:
            # The lower byte is the error type; the upper bytes are details.
            code = getattr(error, "sqlite_errorcode", sqlite3.SQLITE_ERROR) & 0xFF
            unknown = f"The records cannot be used ({short_repr(str(error))})", Remedy.CHECK_DISK
            text, remedy = _FAULTS.get(code, unknown)
            raise InputError(text, self.path, remedy) from error
