"""The lab's records: one SQLite database in the workspace.

Every change is one transaction that is on disk before the call returns (rollback journal,
``synchronous = EXTRA``), so that neither a killed program nor a power cut can lose or split a
confirmed change. The write-ahead log is not used, because it does not work on network disks.
Several programs may use the file at the same time: each waits a few seconds for its turn. Nothing
is ever deleted; a removed entry is only marked and can be restored.
"""

from __future__ import annotations

import sqlite3
import threading
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from datetime import UTC, datetime
from pathlib import Path

from gelpolight_core.errors import InputError, Remedy
from gelpolight_core.io.closing import Closing
from gelpolight_core.io.reading import refusing
from gelpolight_core.records.database import connect, in_plain_words, is_damage, keep_aside
from gelpolight_core.records.entry import MeasurementRecord
from gelpolight_core.records.rows import quantity_rows, records_of, row_of, text_of, write_csv

NAME = "records.sqlite"
BUSY_S = 5.0


class Records(Closing):
    """The records of a workspace, open; any thread may use them.

    Created by :meth:`open`.

    Attributes
    ----------
    path : Path
        The file.
    notice : str
        Message for the user if a damaged file was set aside; otherwise empty.
    """

    def __init__(self, path: Path, connection: sqlite3.Connection, notice: str = "") -> None:
        self.path, self.notice = path, notice
        self._connection = connection
        self._lock = threading.RLock()

    @classmethod
    def open(cls, path: Path, *, busy_s: float = BUSY_S) -> Records:
        """Open or create the records; a damaged file is set aside and a new one is created.

        Parameters
        ----------
        path : Path
            The file; its folder must exist.
        busy_s : float, optional
            Longest time to wait for another program.

        Raises
        ------
        InputError
            If they cannot be opened: another program is using them, the folder has none and is
            read-only, or they have a newer version.
        """
        try:
            return cls(path, connect(path, busy_s))
        except (sqlite3.Error, UnicodeDecodeError) as error:
            if not is_damage(error):
                with in_plain_words(path):
                    raise
        aside = keep_aside(path)
        notice = (
            "The records were damaged. They were saved as "
            f"{aside.name}, and new records were created."
        )
        with in_plain_words(path):
            return cls(path, connect(path, busy_s), notice)

    def add(self, record: MeasurementRecord) -> int:
        """Store a measurement on disk and return its number.

        Raises
        ------
        InputError
            If it cannot be written; then no part of it is stored.
        """
        row = row_of(record)
        with self._writing() as connection:
            self._know(connection, record.serial, record.calibration_id)
            cursor = connection.execute(
                "INSERT INTO measurements (time, serial, calibration_id, shape, verdict, reason,"
                " settings, details, operator, picture, note)"
                " VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
                row,
            )
            number = cursor.lastrowid
            connection.executemany(
                "INSERT INTO quantities VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?, ?)",
                [(number, *row) for row in quantity_rows(record)],
            )
        assert number is not None
        return number

    def measurements(
        self, serial: str | None = None, *, removed: bool = False
    ) -> tuple[MeasurementRecord, ...]:
        """Return measurements in the order in which they were stored, independent of the clock.

        Parameters
        ----------
        serial : str, optional
            Only those of this sensor.
        removed : bool, optional
            Return the removed ones instead of the others.

        Raises
        ------
        InputError
            If they cannot be read.
        """
        chosen = f"m.removed IS {'NOT ' if removed else ''}NULL AND m.serial = ifnull(?, m.serial)"
        with self._reading() as connection:
            rows = connection.execute(
                f"SELECT m.* FROM measurements m WHERE {chosen} ORDER BY m.id", (serial,)
            ).fetchall()
            parts = connection.execute(
                "SELECT q.* FROM quantities q JOIN measurements m ON m.id = q.measurement_id"
                f" WHERE {chosen} ORDER BY q.measurement_id, q.position",
                (serial,),
            ).fetchall()
        with self._refusing():
            return records_of(rows, parts)

    def update_note(self, number: int, note: str) -> None:
        """Change the note of a measurement.

        Parameters
        ----------
        number : int
            Number of the measurement, from :meth:`add`.
        note : str
            The new text.

        Raises
        ------
        InputError
            If the measurement does not exist or cannot be written.
        """
        self._change(number, "note = ?", note)

    def remove(self, number: int) -> None:
        """Mark a measurement as removed; :meth:`restore` restores it.

        Raises
        ------
        InputError
            If the measurement does not exist or cannot be written.
        """
        self._change(number, "removed = ?", text_of(datetime.now(UTC)))

    def restore(self, number: int) -> None:
        """Restore a removed measurement; does nothing for the others.

        Raises
        ------
        InputError
            If the measurement does not exist or cannot be written.
        """
        self._change(number, "removed = ?", None)

    def export_csv(self, path: Path, serial: str | None = None) -> int:
        """Write a table with one line per measured value; return the number of measurements.

        Parameters
        ----------
        path : Path
            The file.
        serial : str, optional
            Only measurements of this sensor.

        Raises
        ------
        InputError
            If the records cannot be read or the file cannot be written.
        """
        records = self.measurements(serial)
        write_csv(records, path)
        return len(records)

    def uses(self, calibration_id: str) -> tuple[int, datetime | None]:
        """Return the number of measurements with a calibration, and the time of the last one.

        Parameters
        ----------
        calibration_id : str
            Identity of the calibration.

        Raises
        ------
        InputError
            If they cannot be read.
        """
        with self._reading() as connection:
            row = connection.execute(
                "SELECT COUNT(*) AS n, MAX(time) AS last FROM measurements"
                " WHERE calibration_id = ? AND removed IS NULL",
                (calibration_id,),
            ).fetchone()
        with self._refusing():
            return int(row["n"]), row["last"] and datetime.fromisoformat(row["last"])

    def know_calibration(
        self, identity: str, serial: str, *, model: str = "", made: str = "", verdict: str = ""
    ) -> None:
        """Store the data of a calibration next to its measurements.

        Parameters
        ----------
        identity, serial : str
            Identity of the calibration, serial number of its sensor.
        model, made, verdict : str, optional
            ``paper`` or ``full``; ISO 8601 time; ``pass``, ``warn`` or ``fail``.

        Raises
        ------
        InputError
            If it cannot be written.
        """
        with self._writing() as connection:
            self._know(connection, serial, identity)
            connection.execute(
                "UPDATE calibrations SET model = ?, made = ?, verdict = ? WHERE id = ?",
                (model, made, verdict, identity),
            )

    def close(self) -> None:
        """Close the file; may be called repeatedly."""
        with self._lock:
            self._connection.close()

    def _refusing(self) -> AbstractContextManager[None]:
        return refusing("The records contain an invalid measurement ({error})", self.path)

    def _change(self, number: int, what: str, value: str | None) -> None:
        with self._writing() as connection:
            changed = connection.execute(
                f"UPDATE measurements SET {what} WHERE id = ?", (value, number)
            )
            if changed.rowcount != 1:
                raise InputError(
                    f"Measurement {number} does not exist",
                    self.path,
                    Remedy.OPEN_AGAIN,
                )

    def _know(self, connection: sqlite3.Connection, serial: str, calibration_id: str) -> None:
        now = text_of(datetime.now(UTC))
        connection.execute("INSERT OR IGNORE INTO sensors VALUES (?, ?)", (serial, now))
        if calibration_id:
            connection.execute(
                "INSERT OR IGNORE INTO calibrations (id, serial, first_seen) VALUES (?, ?, ?)",
                (calibration_id, serial, now),
            )

    @contextmanager
    def _reading(self) -> Iterator[sqlite3.Connection]:
        with self._lock, in_plain_words(self.path):
            self._connection.execute("BEGIN")  # one consistent state for all reads
            try:
                yield self._connection
            finally:
                self._connection.rollback()

    @contextmanager
    def _writing(self) -> Iterator[sqlite3.Connection]:
        with self._lock, in_plain_words(self.path):
            self._connection.execute("BEGIN IMMEDIATE")
            try:
                yield self._connection
                self._connection.execute("COMMIT")
            except BaseException:
                self._connection.rollback()
                raise
