"""What the wizard's camera hands on of what was seen."""

from __future__ import annotations

import numpy as np
from PySide6.QtWidgets import QApplication

from app.calibrate.watching import Watching
from app.sources.processor import Outcome
from app.sources.source import Frame


def test_what_was_seen_for_the_step_before_is_not_told(qapp: QApplication) -> None:
    watching, told = Watching(), list[object]()
    watching.detected.connect(told.append)
    frame = Frame(np.zeros((4, 6, 3), np.uint8), 0, 0.0)
    before = Outcome(watching._processor.generation, frame, "before")
    watching._outbox.put(before)
    watching.look_with(None)
    watching._poll()
    assert told == []
    now = Outcome(watching._processor.generation, frame, "now")
    watching._outbox.put(now)
    watching._poll()
    assert told == [now]
