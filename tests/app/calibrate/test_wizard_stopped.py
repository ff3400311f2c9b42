"""What waits behind work that is stopped is told so, and can come all the same."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from technician import Technician

from app.shell.jobs import Job
from gelpolight_core.calibration.project import CalibrationProject

Made = Callable[[], CalibrationProject]


@pytest.fixture
def hold() -> Iterator[threading.Event]:
    """Return what long work waits for."""
    hold = threading.Event()
    yield hold
    hold.set()


def test_the_curves_come_though_the_work_before_them_was_stopped(
    technician: Technician, computed_project: Made, hold: threading.Event
) -> None:
    technician.begin(computed_project(), "balls")
    wizard = technician.wizard
    wizard.controller.jobs.submit(Job("Long work", lambda _tell: hold.wait(60.0)))
    wizard.go_to("reflectance")
    curves = wizard.curves
    assert curves is not None
    assert "Gathering" in curves._said.text()
    wizard.panel.cancel_wanted.emit()
    hold.set()
    technician.until(lambda: curves.editor is not None)
    technician.rest()


def test_a_report_that_was_stopped_as_it_waited_is_told_as_stopped(
    technician: Technician, computed_project: Made, hold: threading.Event, tmp_path: Path
) -> None:
    technician.begin(computed_project(), "result")
    wizard = technician.wizard
    wizard.controller.jobs.submit(Job("Long work", lambda _tell: hold.wait(60.0)))
    wizard.saving.write_report(tmp_path / "report.html")
    wizard.panel.cancel_wanted.emit()
    hold.set()
    technician.rest()
    assert wizard.result.saved.text() == "Writing the report: stopped"
    assert not (tmp_path / "report.html").exists()
