"""A technician before the wizard, and a camera."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from pytestqt.qtbot import QtBot
from technician import Technician, ToldCamera

from app.calibrate.page import CalibratePage
from app.shell.context import AppContext
from app.sources.source import SourceInfo

LAPTOP = (1180, 740)
"""What the window leaves to a page on a screen of 1280 x 800."""


@pytest.fixture
def camera(context: AppContext) -> ToldCamera:
    """Return a camera that is chosen and shows nothing yet."""
    camera = ToldCamera()
    context.source.choose(SourceInfo("camera", camera.name, "", lambda: camera))
    return camera


@pytest.fixture
def technician(context: AppContext, qtbot: QtBot) -> Iterator[Technician]:
    """Return somebody before a window of a laptop's size."""
    page = CalibratePage(context=context)
    page.resize(*LAPTOP)
    page.show()
    page.enter()
    page.activateWindow()
    qtbot.waitUntil(page.isActiveWindow)
    yield Technician(page, qtbot)
    page.leave()
    page.may_close()
    page.close()
    page.deleteLater()
