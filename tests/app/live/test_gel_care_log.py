"""The presses of the live gel reach the workspace."""

import pytest
from PySide6.QtWidgets import QWidget

from app.live.depth import PressCounter
from app.workspace.gel_care import FILE, read_presses


@pytest.fixture
def log(context, qtbot):
    owner = QWidget()
    qtbot.addWidget(owner)
    context.toasts.attach(owner, lambda: None)
    made = PressCounter(owner, context=context)
    yield made
    made.flush()


def test_presses_are_added_to_those_that_are_kept(log, context):
    for seen in (1, 1, 2, 3, 3):
        log.follow("S-1", seen)
    log.restart()
    log.follow("S-1", 1)
    before = log.lines("S-1")
    log.flush()
    assert read_presses(context.workspace.folder) == {"S-1": 4}
    assert log.lines("S-1") == before
    log.follow("S-1", 2)
    log.flush()
    assert read_presses(context.workspace.folder)["S-1"] == 5
    assert log.lines("S-2") == ()


def test_a_damaged_list_is_reported_once_and_not_overwritten(log, context):
    path = context.workspace.folder / FILE
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("damaged")
    for presses in (1, 2):
        log.follow("S-1", presses)
        log.flush()
    assert path.read_text() == "damaged"
    assert len(context.toasts.shown()) == 1
    path.unlink()
