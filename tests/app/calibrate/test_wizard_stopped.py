"""Work that waited behind stopped work is reported or still done."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator

import pytest
from technician import Technician

from app.services.jobs import Job
from gelpolight_core.calibration.project import Project

Made = Callable[[], Project]


@pytest.fixture
def hold() -> Iterator[threading.Event]:
    """Return the event that the long work waits for."""
    hold = threading.Event()
    yield hold
    hold.set()


def test_the_curves_appear_after_earlier_work_was_stopped(
    technician: Technician, computed_project: Made, hold: threading.Event
) -> None:
    technician.begin(computed_project(), "balls")
    wizard = technician.wizard
    wizard.model.jobs.submit(Job("Long work", lambda _progress: hold.wait(60.0)))
    wizard.go_to("result")
    step = wizard.at("result")
    step.tabs.setCurrentIndex(2)
    curves = step.curves
    assert "Collecting" in curves._message.text()
    wizard.panel.cancel.clicked.emit()
    hold.set()
    technician.until(lambda: curves.editor is not None)
    technician.rest()
