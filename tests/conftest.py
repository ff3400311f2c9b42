"""Fixtures shared by all tests."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from hypothesis import settings

if TYPE_CHECKING:
    from gelpolight_core.calibration.calibration import Calibration
    from gelpolight_core.calibration.pipeline import CalibrationRun

# The same examples on every machine, so that a verdict can be repeated; look further, now and then,
# with --hypothesis-profile=explore.
settings.register_profile("repeatable", derandomize=True, database=None)
settings.register_profile("explore", print_blob=True)
settings.load_profile("repeatable")

SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Return the folder of rendered sessions with truth, or skip where it is absent."""
    if not SHARED_DATA.is_dir():
        pytest.skip(f"the rendered sessions are not at {SHARED_DATA}")
    return SHARED_DATA


@pytest.fixture(scope="session")
def virtual_session(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a session folder of the virtual sensor with its truth, at half the picture's size."""
    from gelpolight_core.design.sensor_design import SensorDesign
    from gelpolight_core.simulation.session import simulate_session

    folder = tmp_path_factory.mktemp("virtual-sensor") / "session"
    simulate_session(SensorDesign(), folder, scale=0.5)
    return folder


@pytest.fixture(scope="session")
def virtual_run(virtual_session: Path) -> CalibrationRun:
    """Return the full model's run on the virtual session; not to be changed."""
    from gelpolight_core.calibration.pipeline import calibrate_session
    from gelpolight_core.session.session import read_session

    return calibrate_session(read_session(virtual_session), model="full")


@pytest.fixture(scope="session")
def virtual_calibration(virtual_run: CalibrationRun) -> Calibration:
    """Return the full model's calibration of the virtual session; not to be changed."""
    return virtual_run.calibration
