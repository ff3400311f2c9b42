"""Records of earlier programs are moved over once, with everything in them."""

import sqlite3
from contextlib import closing
from datetime import UTC, datetime
from pathlib import Path

import pytest

from gelpolight_core.base.compared_quantity import Quantity
from gelpolight_core.base.errors import InputError
from gelpolight_core.lab.measurement_record import MeasurementRecord
from gelpolight_core.lab.measurement_store import NAME, open_records

HERE = Path(__file__).parent
PIN = (
    Quantity("diameter_mm", 5.05, 0.01, 5.0, 5.0, 0.002),
    Quantity("height_mm", 0.97, None, 1.0, 8.0),
)


def at(hour: int) -> datetime:
    return datetime(2026, 11, 20, hour, 30, tzinfo=UTC)


@pytest.fixture
def path(tmp_path):
    """Return the file of an earlier program."""
    with closing(sqlite3.connect(tmp_path / NAME)) as earlier:
        earlier.executescript((HERE / "version_2.sql").read_text("utf-8"))
    return tmp_path / NAME


@pytest.mark.function("Go on with the records of earlier versions")
def test_earlier_records_are_moved_over_and_their_file_is_kept(path):
    before = path.read_bytes()
    with open_records(path) as records:
        assert records.all(MeasurementRecord) == (
            MeasurementRecord(
                "A-1", "c1", "cylinder", PIN, verdict="pass", settings={"model": "full"},
                details={"yaw_deg": None, "centre_mm": [1.25, -0.5]}, operator="Zoë",
                picture="pin.png", note="first\npress", time=at(9), id=1,
            ),
            MeasurementRecord(
                "B-2", "", "ball", (Quantity("diameter_mm", 3.0),), verdict="doubtful",
                reason="25% of the map is missing", time=at(8), id=3,
            ),
            MeasurementRecord(
                "A-1", "c2", "evaluation",
                (Quantity("planar_error_percent", 3.5), Quantity("depth_error_percent", 6.25)),
                verdict="fail", settings={"limits_percent": {"planar": 5.0, "depth": 8.0}},
                details={"groups": [{"name": "cylinder", "count": 3}]}, picture="run",
                time=at(11), id=4,
            ),
        )  # fmt: skip
        removed = MeasurementRecord(
            "A-1", "c1", "cylinder", PIN, note="by mistake", time=at(10), id=2
        )
        records.restore(2)
        assert removed in records.all(MeasurementRecord)
    assert path.with_name("records.version-2.sqlite").read_bytes() == before


def test_they_are_moved_once_and_numbers_go_on(path):
    open_records(path).close()
    moved = path.read_bytes()
    with open_records(path) as records:
        assert path.read_bytes() == moved
        assert records.add(MeasurementRecord("A-1", "", "ball", PIN[:1])) == 5
        records.restore(2)
        assert [r.id for r in records.all(MeasurementRecord)] == [1, 2, 3, 4, 5]


@pytest.mark.parametrize("spoil", [
    "UPDATE measurements SET details = 'no JSON' WHERE id = 3",
    "UPDATE measurements SET note = x'ff' WHERE id = 3",
    "DELETE FROM quantities WHERE measurement_id = 3",
    "DROP TABLE sensors",
])  # fmt: skip
def test_records_that_cannot_be_moved_completely_stay_as_they_are(path, spoil):
    with closing(sqlite3.connect(path)) as earlier:
        earlier.execute(spoil)
        earlier.commit()
    before = path.read_bytes()
    for _ in range(2):
        with pytest.raises(InputError, match="records"):
            open_records(path)
        assert path.read_bytes() == before
