"""A camera that changes although it is locked is detected from its own images."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from gelpolight_core.finding import QualityTable, Verdict
from gelpolight_core.session.camera_steadiness import BANDS, judge_steadiness

TIMES = np.arange(60) / 20.0
SCENE = np.array([0.35, 0.30, 0.25])


def judged(gain: NDArray[np.float64], **options: float) -> QualityTable:
    """Judge images of one scene whose light is multiplied, per frame, band and channel."""
    rng = np.random.default_rng(1)
    levels = SCENE * np.broadcast_to(gain, (len(TIMES), BANDS, 3))
    return judge_steadiness(levels + rng.normal(0.0, 5e-5, levels.shape), TIMES, **options)


def failing(table: QualityTable) -> set[str]:
    return {figure.key for figure in table.figures if figure.verdict is not Verdict.PASS}


def test_exposure_that_the_camera_still_sets_is_a_drift():
    table = judged(1.0 + 0.03 * (TIMES / TIMES[-1])[:, None, None])
    assert failing(table) == {"camera_drift_percent"}
    assert table["camera_drift_percent"].value == pytest.approx(3.0, rel=0.03)


def test_white_balance_that_the_camera_still_sets_is_a_drift_of_colour():
    gain = np.ones((len(TIMES), 1, 3))
    gain[:, 0, 0] += 0.012 * TIMES / TIMES[-1]
    gain[:, 0, 2] -= 0.012 * TIMES / TIMES[-1]
    table = judged(gain)
    assert failing(table) == {"camera_colour_drift_percent"}
    assert table["camera_colour_drift_percent"].value == pytest.approx(1.2, rel=0.05)


def test_flicker_is_found_in_stripes_that_the_image_mean_hides():
    phase = 2.0 * np.pi * (np.arange(BANDS)[None, :] / BANDS + 0.37 * np.arange(60)[:, None])
    table = judged(1.0 + 0.03 * np.sin(phase)[..., None])
    assert failing(table) == {"camera_flicker_percent"}
    assert table["camera_flicker_percent"].value == pytest.approx(3.0 / np.sqrt(2.0), rel=0.05)


def test_a_repeated_or_late_image_is_found():
    table = judged(np.ones((1, 1, 1)), rate_hz=40.0, repeated=40)
    assert failing(table) == {"camera_repeated", "camera_rate_percent"}
    assert table["camera_repeated"].verdict is Verdict.FAIL


@given(st.floats(0.9, 1.1), st.floats(0.05, 2.5))
def test_a_steady_camera_passes_at_any_brightness(gain, brightness):
    levels = np.broadcast_to(SCENE * gain * brightness, (30, BANDS, 3))
    assert failing(judge_steadiness(levels, np.arange(30) / 30.0)) <= {"camera_level"}
