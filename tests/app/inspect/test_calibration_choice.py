"""Which calibration is looked through, and how its reading fares."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from PySide6.QtCore import Qt
from pytestqt.qtbot import QtBot

from app.inspect.calibration_choice import CalibrationBox, CalibrationChoice
from app.shell.context import AppContext
from app.shell.jobs import Job
from gelpolight_core.calibration.calibration import Calibration
from gelpolight_core.calibration.file import write_calibration


class Waiting:
    """Stands for Jobs; nothing begins."""

    def submit(self, job: Job) -> None:
        self.job = job


def _library_of_one(
    context: AppContext, calibration: Calibration, qtbot: QtBot
) -> tuple[Path, CalibrationChoice, Waiting, CalibrationBox]:
    """Return where the only calibration is, and the choice of it with what it works by."""
    path = context.workspace.calibration_path("virtual-1", "small")
    write_calibration(calibration, path)
    box, jobs = CalibrationBox(), Waiting()
    qtbot.addWidget(box)
    return path, CalibrationChoice(jobs, box, context=context), jobs, box  # type: ignore[arg-type]


def test_a_reading_that_was_stopped_is_over(context: AppContext, qtbot: QtBot) -> None:
    """Otherwise the page would say for ever that it takes a moment."""
    box, jobs = CalibrationBox(), Waiting()
    qtbot.addWidget(box)
    choice = CalibrationChoice(jobs, box, context=context)  # type: ignore[arg-type]
    assert not choice.is_reading
    choice._read(Path("a.gplcal"))
    assert choice.is_reading
    jobs.job.over = True
    assert not choice.is_reading


def test_one_whose_reading_was_stopped_is_read_when_it_is_asked_for_again(
    context: AppContext, small_calibration: Calibration, qtbot: QtBot
) -> None:
    """Otherwise only another calibration would help."""
    path, choice, jobs, box = _library_of_one(context, small_calibration, qtbot)
    choice.refresh()
    choice.use_what_fits("", None)
    first = jobs.job
    choice.use_what_fits("", None)
    assert jobs.job is first
    first.over = True
    choice.refresh()
    assert jobs.job is first  # by itself nothing is begun again
    choice.use_what_fits("", None)
    assert jobs.job is not first
    second = jobs.job
    second.over = True
    second.done((path, None, None))
    box.activated.emit(box.currentIndex())
    assert jobs.job is second


def test_the_calibration_before_is_let_go_when_another_is_put_into_use(
    context: AppContext, small_calibration: Calibration, qtbot: QtBot
) -> None:
    """Otherwise it measures on under the other's name, where that is not read to its end."""
    path, choice, jobs, _ = _library_of_one(context, small_calibration, qtbot)
    told: list[tuple[object, object, bool]] = []
    choice.loaded.connect(lambda live, best: told.append((live, best, choice.is_reading)))
    choice.refresh()
    assert told == []
    choice.use_what_fits("", None)
    choice.refresh()
    assert told == [(None, None, True)]
    jobs.job.done((path, "live", "best"))
    choice.refresh()
    assert told[1:] == [("live", "best", False)]


def test_what_was_read_before_the_file_was_replaced_is_not_used(
    context: AppContext, small_calibration: Calibration, qtbot: QtBot
) -> None:
    """As by a second zero while the first is still being read."""
    path, choice, jobs, _ = _library_of_one(context, small_calibration, qtbot)
    choice.refresh()
    choice.use_what_fits("", None)
    choice.refresh()
    first = jobs.job
    write_calibration(replace(small_calibration, factors=0.9 * small_calibration.factors), path)
    choice.refresh()
    second = jobs.job
    assert second is not first
    told: list[tuple[object, object]] = []
    choice.loaded.connect(lambda live, best: told.append((live, best)))
    first.done((path, "live 1", "best 1"))
    assert told == []
    second.done((path, "live 2", "best 2"))
    assert told == [("live 2", "best 2")]


@pytest.mark.parametrize(("serial", "shown"), [("A", "A-12ab"), ("B", "B  A-12ab")])
def test_a_calibration_is_named_once_and_can_be_told_from_others(
    serial: str, shown: str, qtbot: QtBot
) -> None:
    class Entry:
        path = Path("/lab/<b>x.gplcal")
        in_use = True

        class summary:
            identity, picture_size = "A-12ab", (8, 6)

    entry: Any = Entry()
    entry.serial = serial
    box = CalibrationBox()
    qtbot.addWidget(box)
    box.show_entries((entry,))
    assert box.currentText() == shown
    assert "&lt;b&gt;" in box.itemData(1, Qt.ItemDataRole.ToolTipRole)
