"""Nothing is lost: power cuts, full disks, clocks set back, two programs on one workspace."""

import errno
import os
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from recorded import noisy

from app.program.indenters import first_indenters, read_indenters, write_indenters
from gelpolight_core.base.atomic_write import NameTakenError, write_atomically
from gelpolight_core.base.compared_quantity import Quantity
from gelpolight_core.base.errors import InputError
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.lab.measurement_record import MeasurementRecord
from gelpolight_core.lab.measurement_store import NAME, open_records
from gelpolight_core.lab.press_folder import add_presses, leave_out
from gelpolight_core.lab.reference_press import listed_presses
from gelpolight_core.output.recording.recording_format import RecordingHeader
from gelpolight_core.output.recording.recording_reader import Recording
from gelpolight_core.output.recording.recording_writer import RecordingWriter
from gelpolight_core.session.decisions import Decisions, write_decisions
from gelpolight_core.session.file_hashes import FileSnapshots
from gelpolight_core.session.reference_object import ReferenceObject
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.simulation.simulated_session import session_toml

ROOT = Path(__file__).resolve().parents[2]
RECORD = MeasurementRecord("A", "c", "ball", (Quantity("diameter_mm", 3.0, 0.1, 3.0),))


@pytest.fixture
def session(tmp_path):
    folder = tmp_path / "session"
    folder.mkdir()
    (folder / "session.toml").write_text(session_toml(SensorDesign()))
    return folder


def test_a_new_file_is_written_on_a_disk_that_knows_no_links(tmp_path, monkeypatch):
    def refuse(*_: object) -> None:
        raise PermissionError(errno.EPERM, "no links here")

    monkeypatch.setattr(os, "link", refuse)
    write_atomically(tmp_path / "a", lambda stream: stream.write(b"one"), new=True)
    assert (tmp_path / "a").read_bytes() == b"one"
    with pytest.raises(NameTakenError):
        write_atomically(tmp_path / "a", lambda stream: stream.write(b"two"), new=True)
    assert [p.name for p in tmp_path.iterdir()] == ["a"]


@pytest.mark.parametrize("name", ["decisions.toml", "session.toml", "balls"])
def test_a_strangers_session_leads_no_writer_out_of_its_folder(session, tmp_path, name):
    outside = tmp_path / "home"
    outside.mkdir()
    (outside / "precious").write_text((session / "session.toml").read_text())
    target = outside if name == "balls" else outside / "precious"
    if name == "decisions.toml":
        write_decisions(Decisions(), session)
        target.write_bytes((session / name).read_bytes())
    before = {p.name: p.read_bytes() for p in outside.iterdir()}
    (session / name).unlink(missing_ok=True)
    (session / name).symlink_to(target)
    project = CalibrationProject(session)
    with pytest.raises(InputError, match="a link that points outside the folder"):
        match name:
            case "decisions.toml":
                project.place_spot(0, (1.0, 2.0))
            case "session.toml":
                project.set_ball_radius("a.png", 2.0)
            case _:
                project.add_capture("balls", [noisy(1)])
    assert {p.name: p.read_bytes() for p in outside.iterdir()} == before


def test_what_another_program_wrote_into_a_list_of_presses_is_kept(tmp_path):
    (tmp_path / "truth.csv").write_text(
        "file,shape,diameter_mm,height_mm,x_mm\na.png,ball,3,,0.5\n"
    )
    first, second = add_presses(tmp_path, ReferenceObject("ball", 3.0), 2)
    (tmp_path / first).touch()
    leave_out(tmp_path, first)
    (third,) = add_presses(tmp_path, ReferenceObject("ball", 3.0), 1)
    assert third not in (first, second), "an image that was left out is not replaced"
    assert [press.file for press in listed_presses(tmp_path)] == ["a.png", second, third]
    assert (tmp_path / "truth.csv").read_text().splitlines()[1].startswith("a.png,ball,3,,0.5")


def test_a_list_of_indenters_that_another_program_changed_is_not_written_over(tmp_path):
    write_indenters(first_indenters(), tmp_path)
    before = FileSnapshots([tmp_path / "indenters.json"])
    write_indenters(first_indenters()[:1], tmp_path)
    with pytest.raises(InputError, match="Another program has changed"):
        before.refuse_changed(tmp_path / "indenters.json")
    assert len(read_indenters(tmp_path)) == 1


def test_records_stand_in_the_order_in_which_they_were_made_when_the_clock_is_set_back(tmp_path):
    now = datetime.now(UTC)
    with open_records(tmp_path / NAME) as records:
        for hours in (0, -5, -10):
            records.add(replace(RECORD, time=now + timedelta(hours=hours)))
        assert [r.id for r in records.all(MeasurementRecord)] == [1, 2, 3]


def test_a_recording_goes_on_when_the_clock_is_set_back(tmp_path):
    path = tmp_path / "r.gplrec"
    with RecordingWriter(path, RecordingHeader()) as writer:
        for number, time_s in enumerate((100.0, 50.0, 51.0)):
            writer.append(noisy(number), number, time_s)
    with Recording.open(path) as recording:
        assert recording.numbers.tolist() == [0, 1, 2]
        assert not recording.truncated
        assert all(np.array_equal(recording.frame(k).rgb, noisy(k)) for k in range(3))
