"""A press is kept when something is pressed where it should be, and holds still."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gelpolight_core.measurement.steadiness import find_contact, judge_press

ROWS, COLUMNS = 240, 320
PLACE = (150.0, 120.0)


def light(shift_px: float | None) -> np.ndarray:
    """Return light (rows, columns, 3) of a membrane, bare or with walls around a dent."""
    y, x = np.mgrid[:ROWS, :COLUMNS].astype(np.float64)
    glow = np.stack([0.15 + 0.5 * x / COLUMNS, 0.4 - 0.2 * y / ROWS, 0.1 + 0.3 * y / ROWS], -1)
    if shift_px is None:
        return glow
    dx, dy = x - PLACE[0] - shift_px, y - PLACE[1]
    wall = np.exp(-(((np.hypot(dx, dy) - 25.0) / 4.0) ** 2))
    side = (dx / np.maximum(np.hypot(dx, dy), 1.0))[..., None] * np.array([1.0, -0.5, 0.3])
    return np.asarray(glow * (1.0 + 0.6 * wall[..., None] * side))


def shot(shift_px: float | None, seed: int, *, noise: float = 0.01) -> np.ndarray:
    seen = light(shift_px)
    sd = noise * np.sqrt(0.02 + seen)
    seen = seen + sd * np.random.default_rng(seed).standard_normal(seen.shape)
    return np.round(255.0 * np.clip(seen, 0.0, 1.0)).astype(np.uint8)


@settings(max_examples=10, deadline=None)
@given(noise=st.sampled_from([0.002, 0.01, 0.03]), seed=st.integers(0, 1000))
def test_a_still_press_is_accepted_whatever_the_cameras_noise(noise, seed):
    frames = [shot(0.0, seed + k, noise=noise) for k in range(3)]
    bare = shot(None, seed + 9, noise=noise)
    assert judge_press(frames, bare, position_px=PLACE, tolerance_px=9) is None
    assert find_contact(bare, frames[-1]).centre_px == pytest.approx(PLACE, abs=8.0)


def test_the_bare_membrane_is_no_press_even_when_the_light_has_warmed():
    bare = shot(None, 0)
    warm = np.clip(1.03 * bare.astype(float), 0, 255).astype(np.uint8)
    for frame in (shot(None, 1), warm):
        contact = find_contact(bare, frame)
        assert contact.lifted and not contact.pressed
    fault = judge_press([shot(None, k) for k in range(1, 4)], bare)
    assert fault is not None and fault.key == "not_pressed"


def test_a_press_that_slides_is_refused_even_if_no_two_frames_in_a_row_differ():
    bare = shot(None, 0)
    jump = judge_press([shot(0.0, 1), shot(0.0, 2), shot(2.0, 3)], bare)
    creep = judge_press([shot(0.12 * k, k) for k in range(1, 20)], bare)
    for fault in (jump, creep):
        assert fault is not None and fault.key == "moved"
        assert fault.value > 0.1


def test_a_press_beside_the_circle_is_refused_with_how_far():
    frames = [shot(40.0, k) for k in range(3)]
    bare = shot(None, 9)
    fault = judge_press(frames, bare, position_px=PLACE, tolerance_px=15.0)
    assert fault is not None and "pixels away from the circle" in fault.line
    assert judge_press(frames, bare) is None
