"""Fixtures shared by all tests."""

from __future__ import annotations

import fcntl
import hashlib
import os
import pickle
import shutil
import sys
import time
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import pytest
from hypothesis import settings

if TYPE_CHECKING:
    from collections.abc import Callable

    from gelpolight_core.calibration.project import CalibrationProject
    from gelpolight_core.calibration.recipe import StageResults

    MadeOnce = Callable[[str, Callable[[Path], Any]], Any]

# The same examples on every machine, so that a failure can be repeated. To search further, use
# --hypothesis-profile=explore. Examples have no time limit.
settings.register_profile("repeatable", derandomize=True, database=None, deadline=None)
settings.register_profile("explore", print_blob=True, deadline=None)
settings.load_profile("repeatable")

# Settings of pyproject.toml for the tests of windows, which are unknown without pytest-qt.
SETTINGS_OF_PYTEST_QT = ("qt_api", "qt_log_level_fail")

# Files that take longest begin first, so that no process is left alone with one at the end.
LONGEST_FIRST = (
    "app/calibrate/test_wizard.py",
    "golden/test_golden.py",
    "test_accuracy_on_rendered_sensors.py",
    "stages/camera_response/test_bent_sessions.py",
    "lab/batch/test_batch_run.py",
    "app/inspect/test_inspect_page.py",
    "calibration/test_stated.py",
    "calibration/test_causes.py",
    "stages/balls/test_detect_ball.py",
    "reconstruction/test_resolution.py",
    "calibration/closed_sensor/test_plausibility.py",
    "measurement/test_honest_sizes.py",
    "health/test_health_check.py",
    "output/report/test_report.py",
    "app/measure/test_measure_page.py",
    "docs/test_library_guide.py",
    "app/calibrate/test_in_place_route.py",
)

CORE = Path(__file__).resolve().parents[1] / "gelpolight_core"
KEPT_S = 24 * 3600.0  # of what was made for sources that have changed since
SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


def pytest_addoption(parser: pytest.Parser, pluginmanager: pytest.PytestPluginManager) -> None:
    """Add the option for long tests, and accept the settings of pytest-qt without that plugin."""
    parser.addoption("--long", action="store_true", help="run only the tests that take long")
    if not pluginmanager.has_plugin("pytest-qt"):
        for name in SETTINGS_OF_PYTEST_QT:
            parser.addini(name, "of pytest-qt, which is not installed")


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Select the long tests or the others, and put the files that take longest first."""
    selected = [item for item in items if _takes_long(item) in (config.getoption("--long"), None)]
    config.hook.pytest_deselected(items=[item for item in items if item not in selected])
    items[:] = selected
    here = Path(__file__).parent
    order = {here / name: rank for rank, name in enumerate(LONGEST_FIRST)}
    if missing := [path.name for path in order if not path.is_file()]:
        raise pytest.UsageError(f"LONGEST_FIRST names missing files: {missing}")
    items.sort(key=lambda item: order.get(item.path, len(order)))


def _takes_long(item: pytest.Item) -> bool | None:
    """Return whether a test takes long, or None in tests/long, which runs only on request."""
    in_folder = Path(__file__).parent / "long" in item.path.parents
    return None if in_folder else item.get_closest_marker("long") is not None


@pytest.fixture(scope="session")
def shared_data():
    """Return the folder of rendered sessions with truth, or skip where it is absent."""
    if not SHARED_DATA.is_dir():
        pytest.skip(f"the rendered sessions are not at {SHARED_DATA}")
    return SHARED_DATA


@pytest.fixture(scope="session")
def made_once(request, tmp_path_factory):
    """Return a function that makes something in a folder once, for all processes and test runs.

    It is given a name and what makes it; every process gets the pickled result. It is made again
    when a source or a library has changed, or when something else has changed its folder.
    """
    from gelpolight_core.base.atomic_write import write_atomically

    cache = getattr(request.config, "cache", None)
    base = tmp_path_factory.getbasetemp()
    if cache is not None:
        shared = cache.mkdir("made") / _state_of_sources()
    else:
        shared = base.parent if "PYTEST_XDIST_WORKER" in os.environ else base
    shared.mkdir(exist_ok=True)
    os.utime(shared)
    for other in shared.parent.iterdir() if cache is not None else ():
        if other.stat().st_mtime < time.time() - KEPT_S:
            shutil.rmtree(other, ignore_errors=True)

    def once(name: str, make: Callable[[Path], Any]) -> Any:
        folder, made = shared / f"once-{name}", shared / f"once-{name}.pickle"
        # The system ends the lock with its process, also where that is killed.
        with made.with_suffix(".lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            files, result = pickle.loads(made.read_bytes()) if made.exists() else (None, b"")
            if files != _files_of(folder):
                shutil.rmtree(folder, ignore_errors=True)
                folder.mkdir()
                result = pickle.dumps(make(folder))
                whole = pickle.dumps((_files_of(folder), result))
                write_atomically(made, lambda stream: stream.write(whole))
        return pickle.loads(result)

    return once


def _state_of_sources() -> str:
    """Return a name for what decides a result: core, this file, libraries, place, shared data."""
    threads = os.environ.get("OPENBLAS_NUM_THREADS")  # they decide in which order numbers are added
    state = hashlib.sha256(f"{CORE} {sys.version} {threads}".encode())
    for library in ("numpy", "scipy", "opencv-contrib-python-headless", "numba"):
        state.update(version(library).encode())
    for path in (*sorted(CORE.rglob("*")), Path(__file__)):
        if path.suffix in (".py", ".toml", ".json", ".csv"):
            state.update(path.read_bytes())
    state.update(repr(_files_of(SHARED_DATA)).encode())
    return state.hexdigest()[:16]


def _files_of(folder: Path) -> list[tuple[str, int, int]]:
    """Return name, size and time of every file."""
    files = ((path, path.stat()) for path in sorted(folder.rglob("*")) if path.is_file())
    return [(str(path), stat.st_size, stat.st_mtime_ns) for path, stat in files]


@pytest.fixture(scope="session")
def rendered_optics(shared_data, made_once):
    """Return a function that gives the results up to the top surface, from some views or all."""
    from gelpolight_core.calibration.project import run_stage
    from gelpolight_core.calibration.recipe import StageResults
    from gelpolight_core.calibration.recipes import FULL
    from gelpolight_core.session.session import read_session

    def found(sensor: str, views: int = 8) -> StageResults:
        def make(_folder: Path) -> StageResults:
            session, results = read_session(shared_data / sensor), StageResults()
            others = {f"checkerboard/{p.name}" for p in session.files("checkerboard")[views:]}
            decisions = replace(session.decisions, excluded=frozenset(others))
            session = replace(session, decisions=decisions)
            for stage in FULL.stages[:3]:
                results = run_stage(FULL, stage, session, results)
            return results

        return cast("StageResults", made_once(f"optics-{sensor}-{views}", make))

    return found


def _simulated(made_once: MadeOnce, name: str, *, balls: int) -> Path:
    """Return a session with some of the design's balls; a calibration's cost grows with them."""
    from gelpolight_core.simulation.sensor_design import SensorDesign
    from gelpolight_core.simulation.simulated_session import simulate_session

    def make(folder: Path) -> Path:
        design = SensorDesign()
        fewer = replace(design, balls=design.balls[:balls])
        simulate_session(fewer, folder / "session", scale=0.25)
        return folder / "session"

    return made_once(name, make)


@pytest.fixture(scope="session")
def prepared_sensor(made_once):
    """Return the calibration of the virtual sensor: that of the set-up, if it made one."""
    from app.program import prepare

    def make(folder: Path) -> Path:
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(prepare, "folders", lambda: (folder,))
            return prepare.prepare()

    return prepare.prepared() or Path(made_once("prepared-sensor", make))


@pytest.fixture(scope="session")
def small_session(made_once):
    """Return the virtual sensor's session at a quarter of its size: what it costs is counted."""
    return _simulated(made_once, "small-session", balls=5)


@pytest.fixture(scope="session")
def small_session_of_ten_balls(made_once):
    """Return the small session with all balls, which a closed sensor needs."""
    return _simulated(made_once, "small-session-of-ten-balls", balls=10)


@pytest.fixture(scope="session")
def small_run(small_project):
    """Return the run of the full model on the small session; not to be changed."""
    return small_project.finish()


@pytest.fixture(scope="session")
def small_calibration(small_run):
    """Return what the command line makes of the small session; not to be changed."""
    return small_run.calibration


@pytest.fixture(scope="session")
def small_project(small_session, made_once):
    """Return a project on the small session, computed stage by stage; not to be changed."""
    from gelpolight_core.calibration.project import CalibrationProject

    def make(folder: Path) -> Any:
        shutil.copytree(small_session, folder / "session")
        project = CalibrationProject(folder / "session")
        while project.stale():
            project.compute(project.stale()[0])
        return folder / "session", project._results, dict(project._outcomes)

    folder, results, outcomes = made_once("small-project", make)
    project = CalibrationProject(folder)
    project._results, project._outcomes = results, outcomes
    return project


@pytest.fixture
def computed_project(small_project, tmp_path):
    """Return a function that opens a computed project on a folder of its own."""
    from gelpolight_core.calibration.project import CalibrationProject

    def make() -> CalibrationProject:
        folder = tmp_path / "workspace" / "sensors" / "virtual-1" / "sessions" / "session"
        shutil.copytree(small_project.session.folder, folder)
        copied = CalibrationProject(folder)
        copied._results, copied._outcomes = small_project._results, dict(small_project._outcomes)
        return copied

    return make
