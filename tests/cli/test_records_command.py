"""The lab's records on the command line."""

import pytest
from one_line import refusal

from app.cli.main import main
from gelpolight_core.base.compared_quantity import Quantity
from gelpolight_core.lab.measurement_record import MeasurementRecord
from gelpolight_core.lab.measurement_store import NAME, open_records


@pytest.fixture
def workspace(tmp_path):
    """Return a workspace with measurements of two sensors."""
    with open_records(tmp_path / NAME) as records:
        for serial, value in (("A-1", 5.1), ("B-2", 4.9)):
            quantities = (Quantity("diameter_mm", value, 0.01, 5.0, 5.0),)
            records.add(MeasurementRecord(serial, "c", "ball", quantities, verdict="pass"))
    return tmp_path


def test_a_table_of_all_measurements_is_printed(workspace, capsys):
    assert main(["records", "--workspace", str(workspace)]) == 0
    head, *lines = capsys.readouterr().out.splitlines()
    assert "sensor" in head
    assert [line.split()[3] for line in lines] == ["A-1", "B-2"]
    assert "+2.00" in lines[0]


@pytest.mark.function("`gelpolight records`: measurements as text and CSV")
def test_one_sensor_is_chosen_and_written_as_csv(workspace, capsys):
    table = workspace / "b.csv"
    chosen = ["--sensor", "B-2", "--csv", str(table)]
    assert main(["records", "--workspace", str(workspace), *chosen]) == 0
    assert len(capsys.readouterr().out.splitlines()) == 2
    assert [line.split(",")[2] for line in table.read_text("utf-8-sig").splitlines()[1:]] == ["B-2"]


def test_a_folder_without_records_is_refused_and_stays_empty(tmp_path, capsys):
    assert "There are no records" in refusal(capsys, "records", "--workspace", str(tmp_path))
    assert list(tmp_path.iterdir()) == []


def test_the_table_does_not_overwrite_the_records(workspace, capsys):
    chosen = ("records", "--workspace", str(workspace), "--csv")
    kept = (workspace / NAME).read_bytes()
    assert "overwrite" in refusal(capsys, *chosen, str(workspace / NAME))
    assert (workspace / NAME).read_bytes() == kept
