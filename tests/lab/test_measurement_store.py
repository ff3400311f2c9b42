"""The lab's records store measurements for every program that reads them."""

import csv
import math
from dataclasses import dataclass, replace
from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gelpolight_core.base import store
from gelpolight_core.base.compared_quantity import Quantity
from gelpolight_core.base.csv_table import read_csv
from gelpolight_core.base.errors import InputError
from gelpolight_core.base.store import Entry
from gelpolight_core.lab.measurement_record import MeasurementRecord
from gelpolight_core.lab.measurement_store import NAME, open_records, write_csv
from gelpolight_core.measurement.statistics import statistics_of

NOON = datetime(2026, 3, 1, 12, 0, tzinfo=UTC)


def cylinder(height_mm: float, *, hours: float = 0.0, serial: str = "A-1") -> MeasurementRecord:
    """Return a measurement of a cylinder of 5 mm, 1 mm high."""
    return MeasurementRecord(
        serial,
        "c1",
        "cylinder",
        (
            Quantity("diameter_mm", 5.05, 0.01, 5.0, 5.0),
            Quantity("height_mm", height_mm, 0.01, 1.0, 8.0),
        ),
        time=NOON + timedelta(hours=hours),
    )


@pytest.fixture
def records(tmp_path):  # type: ignore[no-untyped-def]
    """Return empty records."""
    with open_records(tmp_path / NAME) as records:
        yield records


numbers = st.floats(allow_nan=False, allow_infinity=False)
known = st.none() | numbers
texts = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=20)
values = st.none() | numbers | texts | st.booleans() | st.lists(numbers)
plain = st.dictionaries(texts, values, max_size=3)
made_quantities = st.builds(
    Quantity, texts, numbers, known, st.none() | numbers.filter(bool), known
)
made_records = st.builds(
    MeasurementRecord,
    serial=texts.filter(bool),
    calibration_id=texts,
    shape=texts,
    quantities=st.lists(
        made_quantities, min_size=1, max_size=3, unique_by=lambda q: q.name
    ).map(tuple),
    verdict=texts,
    reason=texts,
    settings=plain,
    details=plain,
    operator=texts,
    time=st.datetimes(timezones=st.sampled_from([UTC, timezone(timedelta(hours=-7))])).filter(
        lambda time: 1 < time.year < 9999
    ),
    picture=texts,
    note=texts,
)  # fmt: skip


@settings(deadline=None, max_examples=25)
@given(made_records)
def test_stored_measurements_are_read_back(tmp_path_factory, record):
    path = tmp_path_factory.mktemp("kept") / NAME
    with open_records(path) as records:
        number = records.add(record)
    with open_records(path) as records:
        assert records.all(MeasurementRecord) == (replace(record, id=number),)


def test_measurements_are_found_by_sensor(records):
    second = records.add(cylinder(1.01, hours=2.0))
    first = records.add(cylinder(1.02))
    other = records.add(replace(cylinder(1.03, hours=1.0, serial="B-2"), shape="ball"))
    assert [r.id for r in records.all(MeasurementRecord)] == [second, first, other]
    assert [r.id for r in records.all(MeasurementRecord, serial="A-1")] == [second, first]
    assert {r.serial for r in records.all(MeasurementRecord)} == {"A-1", "B-2"}


@pytest.mark.function("See mean, spread and repeatability of repeated measurements")
def test_statistics_of_repeated_measurements():
    heights = [1.00, 1.02, 1.05, 0.99]
    found = statistics_of(heights)
    assert found.count == 4
    assert found.mean == pytest.approx(np.mean(heights))
    assert found.sd == pytest.approx(np.std(heights, ddof=1))
    assert found.spread == pytest.approx(0.06)
    assert np.isnan(statistics_of([1.00]).spread), "one value has none"


def test_two_measurements_differ_by_less_than_the_repeatability_in_95_of_100():
    pairs = np.random.default_rng(4).normal(7.0, 0.3, (50_000, 2))
    limit = statistics_of(pairs.ravel().tolist()).repeatability
    assert np.mean(np.abs(pairs[:, 0] - pairs[:, 1]) < limit) == pytest.approx(0.95, abs=0.005)


def test_the_table_opens_in_a_spreadsheet(records, tmp_path):
    records.add(replace(cylinder(1.04), note='too "soft", said Zoë', operator="Zoë"))
    records.add(cylinder(1.0, serial="B-2"))
    write_csv(records.all(MeasurementRecord, serial="A-1"), tmp_path / "a.csv")
    with (tmp_path / "a.csv").open(encoding="utf-8-sig", newline="") as stream:
        rows = list(csv.DictReader(stream))
    assert [row["quantity"] for row in rows] == ["diameter_mm", "height_mm"]
    assert rows[1]["note"] == 'too "soft", said Zoë'
    assert float(rows[1]["error_percent"]) == pytest.approx(4.0)
    assert float(rows[1]["error"]) == pytest.approx(0.04)
    assert rows[0]["time_utc"] == "2026-03-01 12:00:00"


NUMBERS = "value", "sd", "truth", "error", "error_percent", "limit_percent", "truth_sd", "en"


def test_a_table_with_a_decimal_comma_holds_the_same_numbers(records, tmp_path):
    records.add(replace(cylinder(1.04), note="3.5 N; held"))
    tables = []
    for comma in (False, True):
        write_csv(records.all(MeasurementRecord), tmp_path / "a.csv", comma=comma)
        tables.append([cells for _, cells in read_csv(tmp_path / "a.csv")])
    columns = tables[0][0]
    for point, comma in zip(tables[0][1:], tables[1][1:], strict=True):
        for name, one, other in zip(columns, point, comma, strict=True):
            assert other == (one.replace(".", ",") if name in NUMBERS else one)
    assert tables[1][1][columns.index("error_percent")].count(",") == 1


def test_removed_measurements_are_restored_and_notes_change(records):
    first, second = records.add(cylinder(1.01)), records.add(cylinder(1.02))
    records.remove(first, second)
    assert records.all(MeasurementRecord) == ()
    records.restore(second)
    (kept,) = records.all(MeasurementRecord)
    records.change(replace(kept, note="on the bench"))
    assert records.all(MeasurementRecord) == (replace(kept, note="on the bench"),)


def test_a_change_of_several_measurements_is_made_completely_or_not_at_all(records):
    number = records.add(cylinder(1.01))
    with pytest.raises(InputError, match="no record"):
        records.remove(number, number + 1)
    assert [r.id for r in records.all(MeasurementRecord)] == [number]


@dataclass(frozen=True, slots=True, kw_only=True)
class ZeroCheck(Entry):
    """An entry of another kind."""

    kind = "zero check"
    offset_um: float


@dataclass(frozen=True, slots=True, kw_only=True)
class LaterZeroCheck(Entry):
    """The same kind in a later program."""

    kind = "zero check"
    offset_um: float
    temperature_c: float | None = None


def test_a_later_program_reads_each_kind_of_entry_and_this_one_refuses_its_file(
    tmp_path, monkeypatch
):
    path = tmp_path / NAME
    with open_records(path) as records:
        records.add(cylinder(1.0))
        number = records.add(ZeroCheck(offset_um=2.5, time=NOON))
    with monkeypatch.context() as later:
        later.setattr(store, "VERSION", store.VERSION + 1)
        with open_records(path) as records:
            known = LaterZeroCheck(offset_um=2.5, time=NOON, id=number)
            assert records.all(LaterZeroCheck) == (known,)
            assert len(records.all(MeasurementRecord)) == 1
    with pytest.raises(InputError, match="only reads up to version"):
        open_records(path)
    assert [p.name for p in tmp_path.iterdir()] == [NAME]


def test_what_could_not_be_read_back_is_not_stored(records):
    with pytest.raises(InputError, match="invalid entry"):
        records.add(replace(cylinder(1.0), note="\udcff"))
    assert records.all(MeasurementRecord) == ()


def test_what_no_measurement_is_is_refused():
    for wrong in (math.nan, math.inf):
        with pytest.raises(ValueError, match="not finite"):
            Quantity("height_mm", wrong)
    with pytest.raises(ValueError, match="true value of 0"):
        Quantity("height_mm", 1.0, truth=0.0)
    twice = (Quantity("height_mm", 1.0), Quantity("height_mm", 2.0))
    for quantities in ((), twice):
        with pytest.raises(ValueError, match="different names"):
            MeasurementRecord("A", "", "ball", quantities)
    with pytest.raises(ValueError, match="sensor"):
        MeasurementRecord("", "", "ball", twice[:1])
    with pytest.raises(ValueError, match="zone"):
        MeasurementRecord("A", "", "ball", twice[:1], time=datetime(2026, 1, 1))
