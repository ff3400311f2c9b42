"""What the long proofs share, and how their result is kept: ``sh packaging/test.sh --long``."""

import subprocess
import time
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import pytest

from gelpolight_core.base.version import __version__
from gelpolight_core.calibration.project import assemble, run_stage
from gelpolight_core.calibration.recipe import StageResults
from gelpolight_core.calibration.recipes import FULL
from gelpolight_core.session.session import read_session
from gelpolight_core.simulation.sensor_design import SensorDesign
from gelpolight_core.simulation.simulated_session import simulate_session

STARTED_S = time.monotonic()


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the file of the result."""
    parser.addoption("--keep-result", type=Path, metavar="FILE", help="write the result here")


def pytest_terminal_summary(terminalreporter: Any, config: pytest.Config) -> None:
    """Write when, on what, and how the proofs ended."""
    path = config.getoption("--keep-result")
    if path is None:
        return
    ended = {
        how: [report.nodeid for report in terminalreporter.stats.get(how, [])]
        for how in ("passed", "failed", "error", "skipped")
    }
    lines = [
        "# Last run of the proofs that take long",
        "",
        f"- date: {datetime.now(UTC):%Y-%m-%d %H:%M} UTC",
        f"- version: {__version__}, commit {_commit()}",
        f"- duration: {(time.monotonic() - STARTED_S) / 60.0:.0f} min",
        *(f"- {how}: {len(names)}" for how, names in ended.items()),
        *(f"    - {name}" for how in ("failed", "error") for name in ended[how]),
    ]
    path.write_text("\n".join(lines) + "\n", "utf-8")


def _commit() -> str:
    """Return the commit, marked where files differ from it."""
    command = ["git", "describe", "--always", "--dirty", "--exclude", "*"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    return done.stdout.strip() or "unknown"


@pytest.fixture(scope="session")
def virtual_session(made_once):
    """Return a session folder of the virtual sensor with its truth, at half the image's size."""

    def make(folder: Path) -> Path:
        design = SensorDesign()
        simulate_session(replace(design, balls=design.balls[:6]), folder / "session", scale=0.5)
        return folder / "session"

    return made_once("virtual-session", make)


@pytest.fixture(scope="session")
def virtual_results(virtual_session, made_once):
    """Return the results of every stage on the virtual session; not to be changed."""

    def make(_folder: Path) -> StageResults:
        session, results = read_session(virtual_session), StageResults()
        for stage in FULL.stages:
            results = run_stage(FULL, stage, session, results)
        return results

    return made_once("virtual-results", make)


@pytest.fixture(scope="session")
def virtual_run(virtual_session, virtual_results):
    """Return the full model's run on the virtual session; not to be changed."""
    return assemble(FULL, read_session(virtual_session), virtual_results)


@pytest.fixture(scope="session")
def virtual_calibration(virtual_run):
    """Return the full model's calibration of the virtual session; not to be changed."""
    return virtual_run.calibration


@pytest.fixture(scope="session")
def curved_session(made_once):
    """Return the session of a virtual sensor with a curved membrane, at a quarter of its size."""

    def make(folder: Path) -> Path:
        design = SensorDesign()
        cap = replace(design.membrane, apex_height_mm=2.0)
        curved = replace(design, membrane=cap, balls=design.balls[:6], presses=design.presses[2:3])
        simulate_session(curved, folder / "session", scale=0.25)
        return folder / "session"

    return made_once("curved-session", make)
