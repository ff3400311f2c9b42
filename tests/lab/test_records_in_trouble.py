"""No stored measurement is lost: by a crash, a second program, damage, or a full disk."""

import sqlite3
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path

import pytest

from gelpolight_core.base import store
from gelpolight_core.base.compared_quantity import Quantity
from gelpolight_core.base.errors import InputError
from gelpolight_core.lab.measurement_record import MeasurementRecord
from gelpolight_core.lab.measurement_store import NAME, open_records

RECORD = MeasurementRecord(
    "A-1",
    "c1",
    "ball",
    (Quantity("diameter_mm", 3.05, 0.01, 3.0),),
    time=datetime(2026, 1, 1, tzinfo=UTC),
)


@pytest.mark.parametrize("link", [Path.symlink_to, Path.hardlink_to])
def test_records_are_never_opened_through_a_link(link, tmp_path):
    """Somebody else may write to the folder, too."""
    theirs = tmp_path / "theirs.sqlite"
    open_records(theirs).close()
    before = theirs.read_bytes()
    link(tmp_path / NAME, theirs)
    with pytest.raises(InputError, match="link"):
        open_records(tmp_path / NAME)
    assert theirs.read_bytes() == before


def test_no_records_appear_where_a_dangling_link_points(tmp_path):
    (tmp_path / NAME).symlink_to(tmp_path / "elsewhere.sqlite")
    with pytest.raises(InputError, match="link"):
        open_records(tmp_path / NAME)
    assert not (tmp_path / "elsewhere.sqlite").exists()


def test_a_program_that_locks_the_records_too_long_is_reported(tmp_path, monkeypatch):
    monkeypatch.setattr(store, "BUSY_S", 0.05)
    path = tmp_path / NAME
    with open_records(path) as records:
        records.add(RECORD)
        other = sqlite3.connect(path, isolation_level=None)
        other.execute("BEGIN EXCLUSIVE")
        for use in (lambda: records.add(RECORD), lambda: records.all(MeasurementRecord)):
            with pytest.raises(InputError, match="Another program is using the records"):
                use()
        with pytest.raises(InputError, match="Another program is using the records"):
            open_records(path)
        other.execute("ROLLBACK")
        other.close()
        records.add(RECORD)
        assert len(records.all(MeasurementRecord)) == 2
    assert [p.name for p in tmp_path.iterdir()] == [NAME]


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """Return the bytes of records with some measurements."""
    path = tmp_path_factory.mktemp("whole") / NAME
    with open_records(path) as records:
        for number in range(30):
            records.add(replace(RECORD, note=f"note {number} " * 20))
    return path.read_bytes()


@pytest.mark.function("Know that records are damaged, with their file left as it is")
@pytest.mark.parametrize("kind", ["text", "half", "holes"])
def test_damaged_records_are_refused_and_left_as_they_are(whole, tmp_path, kind):
    path = tmp_path / NAME
    content = {
        "text": b"this was a database once " * 100,
        "half": whole[: len(whole) // 2 // 4096 * 4096],
        "holes": whole[:8192] + bytes(len(whole) - 8192),
    }[kind]
    path.write_bytes(content)
    with pytest.raises(InputError, match="The records are damaged"):
        open_records(path)
    assert path.read_bytes() == content
    assert [p.name for p in tmp_path.iterdir()] == [NAME]


def test_the_database_of_another_program_is_left_alone(tmp_path):
    path = tmp_path / NAME
    other = sqlite3.connect(path)
    other.execute("CREATE TABLE songs (title TEXT)")
    other.commit()
    other.close()
    before = path.read_bytes()
    with pytest.raises(InputError, match="a database of another program"):
        open_records(path)
    assert path.read_bytes() == before


def test_newer_records_are_refused_and_left_as_they_are(tmp_path):
    path = tmp_path / NAME
    with open_records(path) as records:
        records.add(RECORD)
    newer = sqlite3.connect(path)
    newer.execute("PRAGMA user_version = 9")
    newer.commit()
    newer.close()
    before = path.read_bytes()
    with pytest.raises(InputError, match="has version 9, but this program"):
        open_records(path)
    assert path.read_bytes() == before


def test_records_that_can_only_be_read_are_read(tmp_path):
    """As on a disk mounted read-only; permissions would not stop an administrator."""
    path = tmp_path / NAME
    with open_records(path) as records:
        records.add(RECORD)
    with open_records(path) as records:
        records._connection.execute("PRAGMA query_only = ON")
        assert len(records.all(MeasurementRecord)) == 1
        with pytest.raises(InputError, match="The records are read-only"):
            records.add(RECORD)


def test_a_full_disk_loses_the_new_measurement_only(tmp_path):
    path = tmp_path / NAME
    with open_records(path) as records:
        number = records.add(RECORD)
        (pages,) = records._connection.execute("PRAGMA page_count").fetchone()
        records._connection.execute(f"PRAGMA max_page_count = {pages}")
        with pytest.raises(InputError, match="The disk is full"):
            records.add(replace(RECORD, note="x" * 100_000))
        records.add(RECORD)
        assert records.all(MeasurementRecord)[0].id == number
        assert len(records.all(MeasurementRecord)) == 2
