"""Fixtures: a technician who uses the wizard, and a camera."""

from dataclasses import replace

import pytest
from technician import ScriptedCamera, Technician

from app.calibrate.page import CalibratePage
from app.program.preferences import WarningLimits
from app.sources.source import SourceInfo
from gelpolight_core.calibration.project import CalibrationProject
from gelpolight_core.session.description import create_session
from gelpolight_core.session.session import read_session

LAPTOP = (1180, 740)
"""The size that the window leaves for a page on a screen of 1280 x 800."""


@pytest.fixture
def camera(context):
    """Return a selected camera that shows no image yet."""
    camera = ScriptedCamera()
    context.source.choose(SourceInfo("camera", camera.name, "", lambda: camera))
    return camera


@pytest.fixture
def technician(context, qtbot):
    """Return a technician with a window of a laptop's size, who captures by hand."""
    context.settings.prefer(captures_automatically=False)
    # The small sensor knows a height to 11 %: a tolerance of 8 % decides nothing.
    context.settings.limits = WarningLimits(size_percent=30.0, height_percent=30.0)
    page = CalibratePage(context=context)
    page.resize(*LAPTOP)
    page.show()
    page.enter()
    page.activateWindow()
    qtbot.waitUntil(page.isActiveWindow)
    yield Technician(page, qtbot)
    page.leave()
    page.can_close()
    page.close()
    page.deleteLater()


@pytest.fixture
def fresh(small_session, tmp_path):
    """Return a new session of the small sensor without images."""
    folder = tmp_path / "fresh"
    create_session(replace(read_session(small_session), folder=folder))
    return CalibrationProject(folder)
