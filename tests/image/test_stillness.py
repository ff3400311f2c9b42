"""Stillness detection reacts to movement, not to camera noise."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gelpolight_core.image.change_detection import (
    NEVER_S,
    STILL_SHARE,
    StillnessDetector,
    changed_share,
    press_differs,
)

ROWS, COLUMNS = 240, 320
DEPTHS = [np.uint8, np.uint16]


def scene(shift_px: float = 0.0) -> np.ndarray:
    """Return the light (rows, columns, 3) of a membrane with a dent, shifted sideways."""
    y, x = np.mgrid[:ROWS, :COLUMNS].astype(np.float64)
    glow = np.stack([0.15 + 0.5 * x / COLUMNS, 0.4 - 0.2 * y / ROWS, 0.1 + 0.3 * y / ROWS], -1)
    away = np.hypot(x - 150.0 - shift_px, y - 120.0) / 30.0
    return np.asarray(glow * (1.0 - 0.4 * np.clip(1.0 - away**2, 0.0, None))[..., None])


def shot(light: np.ndarray, seed: int, *, noise: float, dtype: type = np.uint8) -> np.ndarray:
    """Return the image of a camera with shot noise, `noise` at full light."""
    sd = noise * np.sqrt(0.02 + light)
    seen = light + sd * np.random.default_rng(seed).normal(size=light.shape)
    top = np.iinfo(dtype).max
    return np.round(np.clip(seen, 0.0, 1.0) * top).astype(dtype)


@settings(max_examples=12, deadline=None)
@given(st.sampled_from([0.002, 0.01, 0.04]), st.sampled_from(DEPTHS), st.integers(0, 1000))
def test_noise_is_not_movement(noise, dtype, seed):
    frames = [shot(scene(), seed + i, noise=noise, dtype=dtype) for i in (0, 1)]
    assert changed_share(*frames) <= STILL_SHARE


@pytest.mark.parametrize("dtype", DEPTHS)
@pytest.mark.parametrize("noise", [0.002, 0.01])
def test_a_dent_shifted_by_three_pixels_is_movement(noise, dtype):
    frames = [shot(scene(3.0 * i), i, noise=noise, dtype=dtype) for i in (0, 1)]
    assert changed_share(*frames) > STILL_SHARE


def test_one_percent_of_lamp_flicker_is_not_movement():
    frames = [shot(scene() * gain, i, noise=0.005) for i, gain in enumerate((1.0, 1.01))]
    assert changed_share(*frames) <= STILL_SHARE


def test_a_press_that_is_lifted_differs_but_a_membrane_in_warmer_light_does_not():
    y, x = np.mgrid[:ROWS, :COLUMNS].astype(np.float64)
    away = np.hypot(x - 150.0, y - 120.0)
    bare = np.full((ROWS, COLUMNS, 3), 0.4)
    wall = np.exp(-(((away - 25.0) / 4.0) ** 2))[..., None]
    first, again = (shot(bare, seed, noise=0.01) for seed in (0, 1))
    assert not press_differs(first, again)
    assert not press_differs(first, shot(1.03 * bare, 2, noise=0.01))
    assert press_differs(shot(bare * (1.0 + 0.6 * wall), 3, noise=0.01), first)


@pytest.mark.parametrize(("rate_hz", "frames"), [(2.0, 3), (8.0, 6), (32.0, 18)])
def test_stillness_must_last_half_a_second_at_any_frame_rate(rate_hz, frames):
    detector = StillnessDetector()
    for position in (0.0, 20.0):  # the time starts again after a movement
        reported = [
            detector.update(shot(scene(position), i, noise=0.005), position + i / rate_hz) >= 1.0
            for i in range(frames)
        ]
        assert reported == [False] * (frames - 1) + [True]


def test_a_movement_is_remembered_until_it_is_used():
    detector = StillnessDetector()
    moved = []
    for n in range(20):
        detector.update(shot(scene(20.0 if n >= 10 else 0.0), n, noise=0.005), n / 8.0)
        moved.append(detector.moved)
        detector.moved = detector.moved and n < 14
    assert moved == [False] * 10 + [True] * 5 + [False] * 5


def test_the_still_time_begins_after_the_last_movement():
    detector, positions = StillnessDetector(), [0.0, 0.0, 3.0, 6.0, 6.0, 6.0]
    ranges = []
    for i, shift_px in enumerate(positions):
        detector.update(shot(scene(shift_px), i, noise=0.005), 10.0 + i)
        ranges.append(detector.still_s)
    assert ranges == [NEVER_S, (11.0, 11.0), NEVER_S, NEVER_S, (14.0, 14.0), (14.0, 15.0)]
