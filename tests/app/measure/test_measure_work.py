"""The picture that is measured on belongs to the page alone."""

from __future__ import annotations

import weakref
from pathlib import Path

from pytestqt.qtbot import QtBot

from app.measure.measuring import Taken
from app.measure.work import Work
from gelpolight_core.calibration.calibration import Calibration
from gelpolight_core.reconstruction.reconstructor import Reconstructor

PATIENCE_MS = 60_000


def test_a_picture_that_is_put_away_is_let_go_and_the_next_one_is_measured(
    small_calibration: Calibration, small_session: Path, qtbot: QtBot
) -> None:
    taken = Taken("press", next((small_session / "presses").glob("cylinder*.png")))
    work = Work()
    work.use(Reconstructor(small_calibration))
    work.take(taken)
    qtbot.waitUntil(lambda: work.answer is not None, timeout=PATIENCE_MS)
    assert work.answer is not None
    linear = weakref.ref(work.answer.linear)
    work.take(None)
    assert not work.busy
    qtbot.waitUntil(lambda: linear() is None)
    work.take(taken)
    qtbot.waitUntil(lambda: work.answer is not None and not work.busy, timeout=PATIENCE_MS)
    work.close()
