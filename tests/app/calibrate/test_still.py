"""A capture that waits for stillness waits for the hand, and not for the camera's noise."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.calibrate.still import MOVING_SHARE, Still, moving_share

ROWS, COLUMNS = 240, 320
DEPTHS = [np.uint8, np.uint16]


def scene(shift_px: float = 0.0) -> np.ndarray:
    """Return light (rows, columns, 3) of a membrane with a dent, moved sideways."""
    y, x = np.mgrid[:ROWS, :COLUMNS].astype(np.float64)
    glow = np.stack([0.15 + 0.5 * x / COLUMNS, 0.4 - 0.2 * y / ROWS, 0.1 + 0.3 * y / ROWS], -1)
    away = np.hypot(x - 150.0 - shift_px, y - 120.0) / 30.0
    return np.asarray(glow * (1.0 - 0.4 * np.clip(1.0 - away**2, 0.0, None))[..., None])


def shot(light: np.ndarray, seed: int, *, noise: float, dtype: type = np.uint8) -> np.ndarray:
    """Return what a camera with shot noise, `noise` at full light, makes of it."""
    sd = noise * np.sqrt(0.02 + light)
    seen = light + sd * np.random.default_rng(seed).normal(size=light.shape)
    top = np.iinfo(dtype).max
    return np.round(np.clip(seen, 0.0, 1.0) * top).astype(dtype)


@settings(max_examples=12, deadline=None)
@given(st.sampled_from([0.002, 0.01, 0.04]), st.sampled_from(DEPTHS), st.integers(0, 1000))
def test_noise_is_no_movement(noise: float, dtype: type, seed: int) -> None:
    frames = [shot(scene(), seed + i, noise=noise, dtype=dtype) for i in (0, 1)]
    assert moving_share(*frames) <= MOVING_SHARE


@pytest.mark.parametrize("dtype", DEPTHS)
@pytest.mark.parametrize("noise", [0.002, 0.01])
def test_a_dent_that_slides_by_three_pixels_is_a_movement(noise: float, dtype: type) -> None:
    frames = [shot(scene(3.0 * i), i, noise=noise, dtype=dtype) for i in (0, 1)]
    assert moving_share(*frames) > MOVING_SHARE


def test_lamps_that_flicker_by_a_percent_are_no_movement() -> None:
    frames = [shot(scene() * gain, i, noise=0.005) for i, gain in enumerate((1.0, 1.01))]
    assert moving_share(*frames) <= MOVING_SHARE


def test_a_black_picture_is_still() -> None:
    black = np.zeros((ROWS, COLUMNS, 3), np.uint8)
    assert moving_share(black, black) == 0.0


@pytest.mark.parametrize(("rate_hz", "frames"), [(2.0, 4), (10.0, 6), (30.0, 16)])
def test_stillness_must_last_half_a_second_whatever_the_rate_at_which_frames_are_looked_at(
    rate_hz: float, frames: int
) -> None:
    watch = Still()
    for place in (0.0, 20.0):  # and begins anew after a movement
        told = [
            watch.update(shot(scene(place), i, noise=0.005), place + i / rate_hz)
            for i in range(frames)
        ]
        assert told == [False] * (frames - 1) + [True]


def test_a_movement_is_told_while_it_lasts() -> None:
    watch = Still()
    told = []
    for number, place in enumerate((0.0, 0.0, 20.0, 20.0)):
        watch.update(shot(scene(place), number, noise=0.005), 0.1 * number)
        told.append(watch.moves)
    assert told == [False, False, True, False]


def test_another_picture_size_starts_the_watch_again() -> None:
    watch = Still()
    told = [watch.update(shot(scene(), i, noise=0.005), float(i)) for i in range(4)]
    assert told[-1]
    small = cv2.resize(shot(scene(), 4, noise=0.005), (160, 120))
    assert not watch.update(small, 4.0)
