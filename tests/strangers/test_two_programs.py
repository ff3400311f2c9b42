"""Two programs on one workspace: both work right, and neither loses what the other one keeps."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

from app.program.settings import AppSettings
from app.program.workspace import Workspace
from gelpolight_core.lab.measurement_record import MeasurementRecord
from gelpolight_core.lab.measurement_store import NAME, open_records
from gelpolight_core.session.session import read_session
from gelpolight_core.session.session_images import read_linear_image
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.simulation.simulated_session import session_toml

HERE = Path(__file__).resolve().parent
ROUNDS = 6

AT_WORK = """
import json, sys
from dataclasses import replace
from pathlib import Path
from recorded import noisy
from written import RECORD, calibration
from app.program.workspace import Workspace
from gelpolight_core.calibration.calibration_file import write_calibration
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.base.errors import InputError

root, who, rounds = Path(sys.argv[1]), sys.argv[2], int(sys.argv[3])
workspace = Workspace(root / "workspace")
source = root / who / "c.gplcal"  # the other one imports a file of the same name
source.parent.mkdir()
made = calibration()
write_calibration(made.changed(noise=made.noise * (1 + (who == "b"))), source)
print("ready", flush=True)
sys.stdin.readline()
project = CalibrationProject(root / "session")
done = {"captures": [], "records": [], "refused": []}
for number in range(rounds):
    try:
        workspace.use(workspace.import_calibration(source))
        done["captures"].append(project.add_capture("balls", [noisy(number)]))
        done["records"].append(workspace.records.add(RECORD))
        project.exclude("balls", done["captures"][-1], True)
    except InputError as error:
        done["refused"].append(str(error))
print(json.dumps(done))
"""


@pytest.fixture(scope="module")
def worked(tmp_path_factory):
    """Let two programs work at once; return the folder, and what each of them has done."""
    root = tmp_path_factory.mktemp("shared")
    (root / "session").mkdir()
    (root / "session" / "session.toml").write_text(session_toml(SensorDesign()))
    paths = os.pathsep.join(map(str, (HERE, *HERE.parents[:2])))
    programs = [
        subprocess.Popen(
            [sys.executable, "-c", AT_WORK, str(root), who, str(ROUNDS)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": paths},
            text=True,
        )
        for who in "ab"
    ]
    for program in programs:
        assert program.stdout is not None
        assert program.stdout.readline() == "ready\n"
    for program in programs:
        assert program.stdin is not None
        program.stdin.write("go\n")
        program.stdin.flush()
    done = [json.loads(program.communicate()[0]) for program in programs]
    assert [program.returncode for program in programs] == [0, 0]
    return root, done


def test_every_image_that_was_reported_to_be_kept_is_there(worked):
    root, done = worked
    names = [name for program in done for name in program["captures"]]
    assert len(set(names)) == len(names) == 2 * ROUNDS
    session = read_session(root / "session")
    assert {path.name for path in session.captured("balls")} == set(names)
    for path in session.captured("balls"):
        read_linear_image(path)


def test_every_measurement_is_there(worked):
    root, done = worked
    with open_records(root / "workspace" / NAME) as records:
        kept = {record.id for record in records.all(MeasurementRecord)}
    assert kept == {number for program in done for number in program["records"]}


@pytest.mark.function("Run two programs in one workspace")
def test_both_calibrations_are_in_the_library_once_and_one_is_in_use(worked):
    workspace = Workspace(worked[0] / "workspace")
    entries = workspace.entries()
    assert len({entry.summary.identity for entry in entries if entry.summary}) == len(entries) == 2
    assert workspace.in_use in [entry.path for entry in entries]


def test_who_decides_second_is_reported_in_a_sentence(worked):
    """A decision is never written over one that was not seen."""
    root, done = worked
    output = {sentence for program in done for sentence in program["refused"]}
    known = ("Another program has changed", "Another program is using the records")
    assert [sentence for sentence in output if not any(part in sentence for part in known)] == []
    assert read_session(root / "session").decisions.excluded


def test_settings_of_both_are_kept(tmp_path):
    one, two = AppSettings(tmp_path / "desktop.ini"), AppSettings(tmp_path / "desktop.ini")
    one.prefer(theme="dark")
    one.save()
    two.prefer(recording_limit_gb=5.0)
    two.save()
    again = AppSettings(tmp_path / "desktop.ini")
    assert (again.preferences.theme, again.preferences.recording_limit_gb) == ("dark", 5.0)
