"""The program is killed at any moment: what it reported as saved is there, every file whole."""

from pathlib import Path

import numpy as np
from killing import lines_until_killed
from recorded import noisy

from app.workspace.indenters import read_indenters
from app.workspace.workspace import Workspace
from gelpolight_core.batch.results import read_table
from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.measurement.ledger import Ledger
from gelpolight_core.measurement.protocol_run import open_run
from gelpolight_core.recording.reader import Recording
from gelpolight_core.records.entry import MeasurementRecord
from gelpolight_core.session.images import read_image
from gelpolight_core.session.session import read_session

HERE = Path(__file__).resolve().parent
LONGEST_S = 0.5

AT_WORK = """
import sys
from dataclasses import replace
from pathlib import Path
from recorded import noisy
from written import RECORD, calibration
from app.workspace.indenters import first_indenters, write_indenters
from app.workspace.workspace import Workspace
from gelpolight_core.batch.results import FrameRow, add_row, write_table
from gelpolight_core.calibration.file import write_calibration
from gelpolight_core.design.sensor_design import SensorDesign
from gelpolight_core.measurement.ledger import Ledger
from gelpolight_core.measurement.protocol import Protocol
from gelpolight_core.measurement.protocol_run import begin_run
from gelpolight_core.recording.recording import RecordingHeader
from gelpolight_core.recording.writer import RecordingWriter
from gelpolight_core.session.description import write_description
from gelpolight_core.session.session import read_session
from gelpolight_core.simulation.session import session_toml

root = Path(sys.argv[1])
for name in ("run", "session"):
    (root / name).mkdir()
(root / "session" / "session.toml").write_text(session_toml(SensorDesign()))
run = begin_run(root / "run", Protocol(), serial="A", calibration="c")
ledger = Ledger(root / "measured.jsonl", "c")
session, workspace = read_session(root / "session"), Workspace(root / "workspace")
made = calibration()
recording = RecordingWriter(root / "r.gplrec", RecordingHeader())
write_table({}, root)

def progress(kind, number):
    print(kind, number, flush=True)

for number, press in enumerate(run.wanted):
    run.accept(press, [noisy(number)])
    progress("press", press.file)
    recording.append(noisy(number), number, float(number))
    progress("recorded", number)
    progress("record", workspace.records.add(RECORD))
    run.refuse(press, "nothing is pressed")
    progress("refusal", number)
    ledger.keep(f"k{number}", "no object is pressed")
    progress("measurement", number)
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


def test_what_was_reported_is_there_and_all_files_are_whole(tmp_path):
    reported = reported_until_killed(tmp_path)
    by_kind: dict[str, list[str]] = {}
    for kind, name in reported:
        by_kind.setdefault(kind, []).append(name)
    run = open_run(tmp_path / "run")
    assert set(by_kind["press"]) <= {press.file for press in run.done}
    for press in run.done:
        read_image(run.image(press))
    assert run.progress.refused >= len(by_kind.get("refusal", []))
    ledger = Ledger(tmp_path / "measured.jsonl", "c")
    assert all(ledger.find(f"k{number}") for number in by_kind.get("measurement", []))
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
