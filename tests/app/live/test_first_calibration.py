"""One click calibrates the virtual sensor, so that new users see depth at once."""

from dataclasses import replace

import pytest

from app.live.first_calibration import IMAGES_SHARE, calibrate_virtual_sensor
from app.workspace.workspace import Workspace
from gelpolight_core.calibration.file import read_calibration
from gelpolight_core.design.sensor_design import SensorDesign

WHOLE = SensorDesign().scaled(0.25)
SMALL = replace(WHOLE, balls=WHOLE.balls[:4], presses=WHOLE.presses[:1])


class Stopped(Exception):
    """The user cancels the work."""


def test_session_and_calibration_are_saved_and_linked(tmp_path):
    workspace, shares = Workspace(tmp_path), list[float]()
    path = calibrate_virtual_sensor(SMALL, workspace, shares.append)
    (session,) = workspace.sessions_folder(SMALL.serial).iterdir()
    assert read_calibration(path).provenance.session == session.name
    assert not session.name.startswith(".")
    assert shares == sorted(shares) and shares[-1] <= 1.0


def test_nothing_is_saved_when_it_is_stopped(tmp_path):
    workspace = Workspace(tmp_path)

    def progress(share: float) -> None:
        if share > IMAGES_SHARE + 0.1:
            raise Stopped

    with pytest.raises(Stopped):
        calibrate_virtual_sensor(SMALL, workspace, progress)
    assert not list(workspace.sessions_folder(SMALL.serial).iterdir())
