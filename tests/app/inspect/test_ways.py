"""The choice between accuracy and speed, as a technician makes it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pytest
from PySide6.QtCore import QObject
from pytestqt.qtbot import QtBot

from app.inspect.products import Shown
from app.inspect.ways import WayChoice, way_text
from app.shell.context import AppContext
from app.shell.jobs import Jobs
from app.sources.source import Frame
from gelpolight_core.calibration.calibration import Calibration
from gelpolight_core.reconstruction.efforts import FOUND, WAYS, Way
from gelpolight_core.reconstruction.reconstructor import Reconstructor

FRAME = np.zeros((4, 4, 3), np.uint8)


@pytest.fixture
def choice(context: AppContext) -> Iterator[WayChoice]:
    owner = QObject()
    jobs = Jobs("ways", owner)
    made = WayChoice(jobs, owner, context=context)
    yield made
    jobs.close()
    made.close()
    made.box.deleteLater()


@pytest.fixture
def full(small_calibration: Calibration) -> Reconstructor:
    return Reconstructor(small_calibration, effort="balanced")


def _pick(choice: WayChoice, way: Way) -> None:
    choice.box.setCurrentIndex(WAYS.index(way))
    choice.box.activated.emit(choice.box.currentIndex())


def test_every_way_is_offered_with_the_errors_that_were_measured(
    choice: WayChoice, full: Reconstructor
) -> None:
    assert not choice.box.isEnabled()
    choice.take(full, full)
    texts = [choice.box.itemText(k) for k in range(choice.box.count())]
    assert len(texts) == len(WAYS) == 4
    assert "fast   0.70 / 0.41 %" in choice.box.currentText()
    assert "2.0 / 2.6 %" in texts[-1]
    errors = [FOUND[way] for way in WAYS[:3]]
    # More effort is truer in both together; heights of balanced and best differ by chance alone.
    assert errors == sorted(errors, key=lambda e: e.height_percent + e.size_percent, reverse=True)


def test_another_effort_is_used_at_once_and_remembered(
    choice: WayChoice, full: Reconstructor, context: AppContext, qtbot: QtBot
) -> None:
    choice.take(full, full)
    with qtbot.waitSignal(choice.chosen) as signal:
        _pick(choice, Way("full", "fast"))
    live, best = signal.args
    assert live.effort == "fast" and best is full
    assert full.effort == "balanced"
    assert live.calibration is full.calibration
    with qtbot.waitSignal(choice.chosen) as signal:
        choice.take(full, full)
    assert signal.args[0].effort == "fast"
    assert context.settings.reconstruction == ("full", "fast")


def test_the_papers_model_is_made_ready_beside_the_window(
    choice: WayChoice, full: Reconstructor, qtbot: QtBot
) -> None:
    choice.take(full, full)
    used: list[Reconstructor] = []
    choice.chosen.connect(lambda live, _best: used.append(live))
    _pick(choice, Way("paper", "best"))
    assert used[-1].model == "full"
    qtbot.waitUntil(lambda: used[-1].model == "paper", timeout=30_000)


def test_a_calibration_of_the_papers_model_leaves_no_choice(
    choice: WayChoice, small_calibration: Calibration, qtbot: QtBot
) -> None:
    paper = Reconstructor(small_calibration, model="paper")
    with qtbot.waitSignal(choice.chosen) as signal:
        choice.take(paper, paper)
    assert signal.args[0] is paper
    assert choice.box.count() == 1 and not choice.box.isEnabled()


def test_a_way_that_was_tried_says_what_it_took_here(
    choice: WayChoice, small_calibration: Calibration, full: Reconstructor
) -> None:
    choice.take(full, full)
    paper = Reconstructor(small_calibration, model="paper")
    camera = small_calibration.camera
    heightmap = paper.depth(np.zeros((camera.height, camera.width, 3), np.uint8))
    for number, taken in enumerate((30.0, 10.0, 20.0)):
        choice.follow(Shown(Frame(FRAME, number, float(number)), heightmap, depth_ms=taken))
    texts = [choice.box.itemText(k) for k in range(choice.box.count())]
    assert texts[-1].endswith("20 ms")
    assert not texts[0].endswith("ms")


def test_settings_that_name_no_way_count_as_the_usual_one(
    choice: WayChoice, context: AppContext
) -> None:
    context.settings.reconstruction = ("full", "heroic")
    assert choice.way == Way("full", "fast")
    assert "2 ms" in way_text(choice.way, 2.0)
