"""The program is killed at any moment: what it reported as saved is there, every file whole."""

from pathlib import Path

import numpy as np
import pytest
from killing import lines_until_killed
from recorded import noisy

from app.program.indenters import read_indenters
from app.program.workspace import Workspace
from gelpolight_core.calibration.calibration_file import read_calibration
from gelpolight_core.lab.batch.batch_table import read_table
from gelpolight_core.lab.measurement_record import MeasurementRecord
from gelpolight_core.lab.reference_press import listed_presses
from gelpolight_core.output.recording.recording_reader import Recording
from gelpolight_core.session.session import read_session
from gelpolight_core.session.session_images import read_linear_image

HERE = Path(__file__).resolve().parent
LONGEST_S = 0.5

AT_WORK = """
import sys
from dataclasses import replace
from pathlib import Path
from recorded import noisy
from written import RECORD, calibration
from app.program.indenters import first_indenters, write_indenters
from app.program.workspace import Workspace
from gelpolight_core.lab.batch.batch_table import FrameRow, add_row, write_table
from gelpolight_core.calibration.calibration_file import write_calibration
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.lab.press_folder import add_presses
from gelpolight_core.output.recording.recording_format import RecordingHeader
from gelpolight_core.output.recording.recording_writer import RecordingWriter
from gelpolight_core.session.reference_object import ReferenceObject
from gelpolight_core.session.description import write_description
from gelpolight_core.session.session_images import write_image
from gelpolight_core.session.session import read_session
from gelpolight_core.simulation.simulated_session import session_toml

root = Path(sys.argv[1])
(root / "session").mkdir()
(root / "session" / "session.toml").write_text(session_toml(SensorDesign()))
session, workspace = read_session(root / "session"), Workspace(root / "workspace")
made = calibration()
recording = RecordingWriter(root / "r.gplrec", RecordingHeader())
write_table({}, root)

def progress(kind, number):
    print(kind, number, flush=True)

for number in range(200):
    (file,) = add_presses(root / "presses", ReferenceObject("ball", 3.0), 1)
    progress("listed", file)
    write_image(noisy(number), root / "presses" / file)
    progress("press", file)
    recording.append(noisy(number), number, float(number))
    progress("recorded", number)
    progress("record", workspace.records.add(RECORD))
    add_row(FrameRow(f"a{number}", "a.png", "c", "s"), root)
    progress("frame", number)
    radii = {f"ball_{k}.png": 2.0 for k in range(number + 1)}
    write_description(replace(session, ball_radii_mm=radii))
    progress("radius", number)
    write_indenters(first_indenters()[number % 3 :], workspace.folder)
    progress("indenters", number % 3)
    path = workspace.calibration_path("T-1", f"c{number}")
    write_calibration(made.changed(noise=made.noise * (number + 1)), path)
    workspace.use(path)
    progress("calibration", path.name)
"""


def reported_until_killed(root: Path) -> list[list[str]]:
    """Let a program write, kill it, and return what it reported."""
    lines = lines_until_killed(
        ["-c", AT_WORK, str(root)], paths=(HERE, *HERE.parents[:2]), seed=1, longest_s=LONGEST_S
    )
    return [line.split() for line in lines]


@pytest.mark.function("Kill the program without losing what was reported as saved")
def test_what_was_reported_is_there_and_all_files_are_whole(tmp_path):
    reported = reported_until_killed(tmp_path)
    by_kind: dict[str, list[str]] = {}
    for kind, name in reported:
        by_kind.setdefault(kind, []).append(name)
    presses = tmp_path / "presses"
    assert set(by_kind["listed"]) <= {press.file for press in listed_presses(presses)}
    for file in by_kind.get("press", []):
        read_linear_image(presses / file)
    assert {f"a{number}" for number in by_kind.get("frame", [])} <= read_table(tmp_path).keys()
    with Recording.open(tmp_path / "r.gplrec") as recording:
        assert len(recording) >= len(by_kind.get("recorded", []))
        for index in range(len(recording)):
            assert np.array_equal(recording.frame(index).rgb, noisy(index))
    session = read_session(tmp_path / "session")
    assert len(session.ball_radii_mm) >= len(by_kind.get("radius", []))
    workspace = Workspace(tmp_path / "workspace")
    if "indenters" in by_kind:
        assert read_indenters(workspace.folder)
    entries = {entry.path.name for entry in workspace.entries() if not entry.broken}
    assert set(by_kind.get("calibration", [])) <= entries
    with workspace.records as records:
        kept = {str(record.id) for record in records.all(MeasurementRecord)}
    assert set(by_kind.get("record", [])) <= kept
    if workspace.in_use is not None:
        read_calibration(workspace.in_use)
