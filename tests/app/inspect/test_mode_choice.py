"""The choice between accuracy and speed, as a technician makes it."""

import numpy as np
import pytest
from PySide6.QtCore import QObject

from app.inspect.mode_choice import ModeChoice
from app.live.frame_processor import FrameResult
from app.program.jobs import JobQueue
from app.sources.source import SourceFrame
from gelpolight_core.reconstruction.modes import FOUND, MODES, Mode
from gelpolight_core.reconstruction.reconstructor import Reconstructor

FRAME = np.zeros((4, 4, 3), np.uint8)


@pytest.fixture
def chosen():
    """Return the reconstructors that were chosen."""
    return []


@pytest.fixture
def choice(context, chosen):
    owner = QObject()
    jobs = JobQueue("modes", owner)
    made = ModeChoice(jobs, owner, lambda *pair: chosen.append(pair), context=context)
    yield made
    jobs.close()
    made.close()
    made.box.deleteLater()


@pytest.fixture
def full(small_calibration):
    return Reconstructor(small_calibration, effort="balanced")


def _pick(choice: ModeChoice, mode: Mode) -> None:
    choice.box.setCurrentIndex(MODES.index(mode))
    choice.box.activated.emit(choice.box.currentIndex())


@pytest.mark.function("Choose between accuracy and speed, with the measured errors of each mode")
def test_every_mode_is_offered_with_its_measured_errors(choice, full):
    assert not choice.box.isEnabled()
    choice.offer(full, full)
    texts = [choice.box.itemText(k) for k in range(choice.box.count())]
    assert len(texts) == len(MODES) == 4
    assert "fast (±0.3 %)" in choice.box.currentText()
    assert "±2.6 %" in texts[-1]
    errors = [FOUND[mode] for mode in MODES[:3]]
    # More effort is more accurate in both together. The height errors of balanced and best differ
    # only by chance.
    assert errors == sorted(errors, key=lambda e: e.height_percent + e.size_percent, reverse=True)


def test_another_effort_is_used_at_once_and_saved(choice, full, context, chosen):
    choice.offer(full, full)
    _pick(choice, Mode("full", "fast"))
    live, best = chosen[-1]
    assert live is not None and live.effort == "fast" and best is full
    assert full.effort == "balanced"
    assert live.calibration is full.calibration
    choice.offer(full, full)
    assert chosen[-1][0] is not None and chosen[-1][0].effort == "fast"
    assert context.settings.preferences.mode == Mode("full", "fast")


def test_a_calibration_of_the_papers_model_offers_one_mode(choice, small_calibration, chosen):
    paper = Reconstructor(small_calibration, model="paper")
    choice.offer(paper, paper)
    assert chosen[-1][0] is paper
    assert choice.box.count() == 1 and not choice.box.isEnabled()


def test_a_mode_shows_its_measured_time(choice, small_calibration, full):
    choice.offer(full, full)
    paper = Reconstructor(small_calibration, model="paper")
    camera = small_calibration.camera
    heightmap = paper.depth(np.zeros((camera.height, camera.width, 3), np.uint8))
    for number, taken in enumerate((30.0, 10.0, 20.0)):
        choice.follow(
            FrameResult(SourceFrame(FRAME, number, float(number)), heightmap, depth_ms=taken)
        )
    texts = [choice.box.itemText(k) for k in range(choice.box.count())]
    assert "50/s" in texts[-1]
    assert "/s" not in texts[0]
