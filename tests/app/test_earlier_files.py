"""Files that earlier states of the program wrote (tests/data) are opened, with their values."""

import shutil
from pathlib import Path

import numpy as np
import pytest

from app.program.indenters import read_indenters
from app.program.preferences import WarningLimits
from app.program.settings import AppSettings
from app.program.workspace import Workspace
from gelpolight_core.calibration.calibration_file import read_calibration
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.calibration.stage_status import StageState
from gelpolight_core.lab.measurement_record import MeasurementRecord
from gelpolight_core.measurement.object_measurement import measure_heightmap
from gelpolight_core.output.raster import read_npz
from gelpolight_core.output.recording.recording_format import RecordedFrame
from gelpolight_core.output.recording.recording_reader import Recording
from gelpolight_core.reconstruction.modes import Mode
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.session.decisions import PlacedCircle

DATA = Path(__file__).resolve().parents[1] / "data"
EARLIER, CLOSED, LATER = "2026-11-21", "2026-11-23-closed", "2026-11-23"
NEWEST = "2026-11-25"
SENSOR = "workspace/sensors/small-1"
# The true press: a cylinder of 5 mm, 1 mm deep. Pixels of 0.16 mm blur its edge by half of that,
# and six balls at this size leave height errors of 4 to 8 %, which the calibrations state.
DIAMETER_MM, HEIGHT_MM = 5.0, 1.0
# Of size and height. Nodes of 0.165 mm do not show the fillet of an edge.
ERRORS_MM = {"first": (0.2, 0.08), "closed": (1.1, 0.03)}
# Deepest node of the height maps as they were written.
DEEPEST_MM = {EARLIER: 0.94, NEWEST: 0.958}


def frames(folder: str) -> list[RecordedFrame]:
    with Recording.open(DATA / folder / SENSOR / "recordings/press.gplrec") as recording:
        return [recording.frame(index) for index in range(len(recording))]


@pytest.fixture
def workspace(tmp_path, request):
    """Return a writable copy of a workspace: opening the records may change their file."""
    folder = tmp_path / "workspace"
    shutil.copytree(DATA / request.param / "workspace", folder)
    opened = Workspace(folder)
    request.addfinalizer(opened.close)
    return opened


@pytest.mark.parametrize("folder", [EARLIER, CLOSED, LATER, NEWEST])
def test_a_calibration_measures_the_recorded_press(folder):
    image, paths = frames(EARLIER)[1].rgb, sorted((DATA / folder / SENSOR).glob("*.gplcal"))
    assert paths
    for path in paths:
        found = measure_heightmap(
            Reconstructor(read_calibration(path)).depth(image), shape="cylinder"
        )
        size_mm, height_mm = ERRORS_MM[path.stem]
        assert found.size_mm == pytest.approx(DIAMETER_MM, abs=size_mm)
        assert abs(found.size_mm - DIAMETER_MM) < 2.0 * found.size_sd_mm
        assert found.height_mm == pytest.approx(HEIGHT_MM, abs=height_mm)


@pytest.mark.function(
    "Open calibrations of earlier versions", "Open height maps of earlier versions"
)
@pytest.mark.parametrize("folder", [EARLIER, NEWEST])
def test_an_earlier_calibration_gives_the_depth_of_its_own_program(folder):
    calibration = read_calibration(DATA / folder / SENSOR / "first.gplcal")
    then = read_npz(DATA / folder / "height_map/cylinder_s5_d100.npz")

    now = Reconstructor(calibration).depth(frames(EARLIER)[1].rgb)

    assert then.calibration_id == calibration.identity == now.calibration_id
    assert then.pitch_mm == pytest.approx(now.pitch_mm, rel=1e-6)
    difference_um = 1000.0 * np.abs(now.depth_mm - then.depth_mm)
    # Images are sharpened now: walls are steeper.
    assert np.percentile(difference_um, 99) < 20.0
    assert then.depth_mm.max() == pytest.approx(DEEPEST_MM[folder], abs=0.01)


@pytest.mark.parametrize("folder", [EARLIER, LATER, NEWEST])
def test_a_recording_keeps_frames_numbers_and_description(folder):
    with Recording.open(DATA / folder / SENSOR / "recordings/press.gplrec") as recording:
        header = recording.header
    untouched, pressed = frames(folder)

    assert (untouched.number, pressed.number) == (4, 6)
    assert pressed.time_s - untouched.time_s == pytest.approx(2 / 30)
    assert untouched.rgb.shape == pressed.rgb.shape == (144, 192, 3)
    assert (header.serial, header.kind) == ("small-1", "virtual")
    assert header.settings == {"exposure_us": 8000.0}
    assert np.abs(pressed.rgb.astype(int) - untouched.rgb).max() > 50


@pytest.mark.parametrize("workspace", [EARLIER, LATER, NEWEST], indirect=True)
def test_a_workspace_knows_its_calibration_validation_and_records(workspace):
    entry = next(entry for entry in workspace.entries() if entry.in_use)
    kept = workspace.records.all(MeasurementRecord)

    assert entry.path.name == "first.gplcal"
    assert entry.validation is not None
    assert [c.name for c in entry.validation.comparisons] == ["diameter", "height"]
    assert entry.validated
    assert [record.note for record in kept] == ["first press"]
    values = {q.name: (q.value, q.truth) for q in kept[0].quantities}
    assert values["diameter_mm"] == (pytest.approx(DIAMETER_MM, abs=0.08), DIAMETER_MM)
    assert values["height_mm"] == (pytest.approx(HEIGHT_MM, abs=0.08), HEIGHT_MM)
    assert workspace.uses(kept[0].calibration_id)[0] == 1
    pin, block = read_indenters(workspace.folder)
    assert (pin.name, pin.shape, pin.size_mm, pin.height_mm) == ("Pin A", "cylinder", 5.0, 1.0)
    assert (block.shape, block.mean_size_mm) == ("cuboid", 5.0)


@pytest.mark.function("Open sessions, recordings, records and workspaces of earlier versions")
@pytest.mark.parametrize("workspace", [EARLIER], indirect=True)
def test_an_unfinished_session_continues(workspace):
    (entry,) = workspace.sessions()
    statuses = CalibrationProject(entry.folder).statuses()

    assert statuses["balls"].state is not StageState.EMPTY
    assert statuses["top_pose"].state is StageState.EMPTY
    assert entry.serial == "small-1"


@pytest.mark.parametrize("workspace", [NEWEST], indirect=True)
def test_a_session_keeps_the_decisions_about_its_images(workspace):
    sessions = workspace.folder / "sensors/small-1/sessions"
    opened = CalibrationProject(sessions / "unfinished").session.decisions
    closed = CalibrationProject(sessions / "closed").session

    assert opened.excluded == {"balls/ball_00.png", "checkerboard/view_03.png"}
    assert opened.spots_px == {1: (40.5, 60.25)}
    assert opened.curves == {2: ((0.2, 0.15), (0.6, 0.55), (1.0, 1.0))}
    assert closed.decisions.balls == {"ball_01.png": PlacedCircle(96.5, 80.25, 14.0)}
    assert [path.name for path in closed.found("balls")] == ["ball_00.png", "ball_01.png"]


@pytest.mark.parametrize("workspace", [CLOSED], indirect=True)
def test_a_closed_session_has_its_scale_and_balls(workspace):
    project = CalibrationProject(workspace.folder / "sensors/small-1/sessions/closed")

    assert len(project.session.found("balls")) == 3
    assert project.session.in_place.stated_scale == pytest.approx(0.165, abs=0.001)
    assert project.session.ball_radii_mm["ball_01.png"] == 4.0


@pytest.mark.parametrize("folder", [EARLIER, LATER, NEWEST])
def test_settings_of_the_window_are_kept(folder, tmp_path):
    file = Path(shutil.copy(DATA / folder / "desktop.ini", tmp_path))
    settings = AppSettings(file)

    assert settings.preferences.theme == "dark"
    assert settings.limits == WarningLimits(age_days=30.0, height_percent=6.0, size_percent=3.0)
    assert settings.preferences.mode == Mode()  # the one that was kept is not offered any more
    assert settings.camera("usb-1") == {"gain": "2.5"}
    assert settings.recent("sessions") == (Path("/lab/session"),)
    assert bytes(settings.window_state()[0].data()) == b"geometry"
