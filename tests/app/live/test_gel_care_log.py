"""The presses of the live gel reach the workspace."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from PySide6.QtWidgets import QWidget
from pytestqt.qtbot import QtBot

from app.context.context import AppContext
from app.live.gel_care import GelCareLog
from app.workspace.gel_care import FILE, GelCare, read_gel_care
from gelpolight_core.health.watch import Gel


@pytest.fixture
def log(context: AppContext, qtbot: QtBot) -> Iterator[GelCareLog]:
    owner = QWidget()
    qtbot.addWidget(owner)
    context.toasts.attach(owner, lambda: None)
    made = GelCareLog(owner, context=context)
    yield made
    made.flush()


def test_presses_and_recoveries_are_added_to_what_is_kept(
    log: GelCareLog, context: AppContext
) -> None:
    for seen in (Gel(1), Gel(1), Gel(1, 0.5), Gel(1, 0.5), Gel(2, 0.5), Gel(3), Gel(3, 0.7)):
        log.follow("S-1", seen)
    log.restart()
    log.follow("S-1", Gel(1, 0.9))
    expected = GelCare(4, (0.5, 0.5, 0.7, 0.9), (0.5, 0.5, 0.7, 0.9))
    before = log.lines("S-1")
    log.flush()
    assert read_gel_care(context.workspace.folder) == {"S-1": expected}
    assert log.lines("S-1") == before
    log.follow("S-1", Gel(2))
    log.flush()
    assert read_gel_care(context.workspace.folder)["S-1"].presses == 5
    assert log.lines("S-2") == ()


def test_a_damaged_list_is_reported_once_and_not_overwritten(
    log: GelCareLog, context: AppContext
) -> None:
    path = context.workspace.folder / FILE
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("damaged")
    for presses in (1, 2):
        log.follow("S-1", Gel(presses))
        log.flush()
    assert path.read_text() == "damaged"
    assert len(context.toasts.shown()) == 1
    path.unlink()
