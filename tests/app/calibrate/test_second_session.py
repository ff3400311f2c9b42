"""A new session of a sensor that has an unfinished one is made only if the user wants it."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from PySide6.QtWidgets import QPushButton

from app.calibrate.page import CalibratePage
from app.program.context import AppContext
from app.source_ui.virtual_session import virtual_session
from app.widgets.dialog import QuestionDialog
from gelpolight_core.session.description import create_session
from gelpolight_core.session.session import Session

SERIAL = "A-001"


@pytest.fixture
def page(context, qtbot):
    made = CalibratePage(context=context)
    qtbot.addWidget(made)
    yield made
    made.can_close()


@pytest.fixture
def unfinished(context):
    """Return a session of the sensor with one image and without a calibration."""
    folder = context.workspace.sessions_folder(SERIAL) / "2026-01-02"
    create_session(replace(stated(), folder=folder))
    (folder / "checkerboard").mkdir(exist_ok=True)
    cv2.imwrite(str(folder / "checkerboard" / "view_1.png"), np.zeros((48, 64, 3), np.uint8))
    return folder


def stated(serial: str = SERIAL) -> Session:
    """Return what the form says of the sensor."""
    session = virtual_session()
    return replace(session, sensor=replace(session.sensor, serial=serial))


def _begin(page: CalibratePage, serial: str = SERIAL) -> list[QuestionDialog]:
    """Start from the form, and return the questions that are asked."""
    page.form.accepted.emit(stated(serial))
    return [question for question in page.findChildren(QuestionDialog) if question.isVisible()]


def _sessions(context: AppContext, serial: str = SERIAL) -> int:
    return sum(session.serial == serial for session in context.workspace.sessions())


@pytest.mark.parametrize(("chosen", "sessions"), [("answer0", 1), ("answer1", 2)])
def test_the_unfinished_session_is_continued_or_a_second_is_made_as_the_user_wants(
    page, unfinished, context, chosen, sessions
):
    (question,) = _begin(page)
    assert page.wizard is None and _sessions(context) == 1
    button = question.findChild(QPushButton, f"question.{chosen}")
    button.click()
    assert page.wizard is not None
    assert (page.wizard.model.project.session.folder == unfinished) is (sessions == 1)
    assert _sessions(context) == sessions
    assert (unfinished / "checkerboard" / "view_1.png").is_file()


def test_an_empty_session_or_another_sensor_is_no_reason_to_ask(page, unfinished, context):
    assert _begin(page, "B-002") == []
    assert page.wizard is not None and _sessions(context, "B-002") == 1
    (unfinished / "checkerboard" / "view_1.png").unlink()
    assert _begin(page) == []
    assert _sessions(context) == 2
