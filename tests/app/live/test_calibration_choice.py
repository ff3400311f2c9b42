"""Selecting and reading the calibration of the page."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import scene
from PySide6.QtWidgets import QWidget
from pytestqt.qtbot import QtBot

from app.live.calibration_choice import CalibrationChoice
from app.program.context import AppContext
from app.program.jobs import BackgroundJob
from gelpolight_core.base.compared_quantity import Quantity
from gelpolight_core.calibration.annotations import write_validation
from gelpolight_core.calibration.calibration_file import write_calibration
from gelpolight_core.calibration.manifest import read_summary
from gelpolight_core.sensor.sensor_calibration import Calibration
from gelpolight_core.session.validation import Validation


class Waiting:
    """Replaces Jobs; no job starts."""

    def submit(self, job: BackgroundJob) -> None:
        self.job = job


def _library_of_one(
    context: AppContext,
    calibration: Calibration,
    qtbot: QtBot,
    loaded: Callable[..., object] = lambda *_: None,
) -> tuple[Path, CalibrationChoice, Waiting]:
    """Return the path of the only calibration, its CalibrationChoice, and the objects it uses."""
    path = context.workspace.calibration_path("virtual-1", "small")
    write_calibration(calibration, path)
    owner, jobs = QWidget(), Waiting()
    qtbot.addWidget(owner)
    choice = CalibrationChoice(jobs, owner, loaded, context=context)  # type: ignore[arg-type]
    return path, choice, jobs


def test_a_calibration_is_read_again_after_a_stopped_reading(context, small_calibration, qtbot):
    """Otherwise only another calibration would help."""
    path, choice, jobs = _library_of_one(context, small_calibration, qtbot)
    choice.refresh()
    choice.use_matching_calibration("", None)
    first = jobs.job
    choice.use_matching_calibration("", None)
    assert jobs.job is first
    first.over = True
    choice.refresh()
    assert jobs.job is first  # nothing restarts by itself
    choice.use_matching_calibration("", None)
    assert jobs.job is not first
    second = jobs.job
    second.over = True
    second.done((path, None, None))
    choice.use_matching_calibration("", None)
    assert jobs.job is second


def test_a_replaced_file_is_read_again(context, small_calibration, qtbot):
    """For example by a second zero while the first file is still being read."""
    reported: list[tuple[object, object]] = []
    path, choice, jobs = _library_of_one(
        context, small_calibration, qtbot, lambda *pair: reported.append(pair)
    )
    choice.refresh()
    choice.use_matching_calibration("", None)
    choice.refresh()
    first = jobs.job
    write_calibration(small_calibration.changed(factors=0.9 * small_calibration.data.factors), path)
    choice.refresh()
    second = jobs.job
    assert second is not first
    reported.clear()
    first.done((path, "live 1", "best 1"))
    assert reported == []
    second.done((path, "live 2", "best 2"))
    assert reported == [("live 2", "best 2")]


def test_matching_is_the_newest_validated_one_and_never_one_that_failed(context, qtbot):
    owner, workspace = QWidget(), context.workspace
    qtbot.addWidget(owner)
    choice = CalibrationChoice(Waiting(), owner, print, context=context)  # type: ignore[arg-type]
    plain = scene.calibration()

    def kept(day: int, calibration: Calibration) -> Path:
        provenance = replace(plain.provenance, created=f"2026-01-{day:02}T00:00:00+00:00")
        made = replace(calibration, provenance=provenance).changed(factors=day * plain.data.factors)
        return workspace.keep_calibration(made, f"day {day}")

    kept(4, scene.failed(plain))
    choice.refresh()
    choice.use_matching_calibration("T-1", None)
    assert workspace.in_use is None
    days = {day: kept(day, plain) for day in (1, 2, 3)}
    choice.refresh()
    choice.use_matching_calibration("T-1", None)
    assert workspace.in_use == days[3]
    for day in (1, 2):
        trial = (Quantity("height", 1.0, truth=1.0, limit_percent=8.0),)
        identity = read_summary(days[day]).identity
        write_validation(Validation(identity, "2026", "Ada", "cylinder", trial), days[day])
    choice.refresh()
    choice.use_matching_calibration("T-1", None)
    assert workspace.in_use == days[2]
