"""Averaging before the solve: even parts become quiet, edges stay where and as they are."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from gelpolight_core.reconstruction.denoise import noise_left, quiet_even_parts


def picture(noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a clean picture with a slow slope and one step, and the same with noise."""
    rng = np.random.default_rng(0)
    clean = np.tile(np.linspace(0.4, 0.5, 200), (160, 1))
    clean[:, 120:] += 0.3
    clean = np.repeat(clean[..., None], 3, axis=2)
    return clean, (clean + rng.normal(0, noise, clean.shape)).astype(np.float32)


def test_noise_goes_and_the_step_stays() -> None:
    clean, noisy = picture(0.01)
    quiet = quiet_even_parts(noisy, np.ones((160, 200), bool))
    even = np.s_[10:-10, 10:100]
    assert (quiet - clean)[even].std() < 0.35 * (noisy - clean)[even].std()
    # The step itself is used as it is: no pixel of it is averaged across.
    np.testing.assert_allclose(quiet[20:140, 118:122], noisy[20:140, 118:122], atol=1e-3)


def test_a_picture_without_noise_or_without_membrane_is_left_alone() -> None:
    clean, noisy = picture(0.0)
    quiet = quiet_even_parts(noisy, np.ones((160, 200), bool))
    assert np.abs(quiet - clean).max() < 2e-3
    untouched = quiet_even_parts(noisy, np.zeros((160, 200), bool))
    np.testing.assert_array_equal(untouched, noisy)


@pytest.mark.parametrize("shift", [0.0, 0.3, 0.5])
def test_the_noise_that_is_left_is_known(shift: float) -> None:
    """Raw noise, resampled between the pixels and quieted, beside what is stated."""
    random = np.random.default_rng(1)
    clean = np.full((160, 200, 3), 0.5, np.float32)
    raw = clean + random.normal(0, 0.01, clean.shape).astype(np.float32)
    move = np.float32([[1, 0, shift], [0, 1, shift]])
    seen = cv2.warpAffine(raw, move, (200, 160), borderMode=cv2.BORDER_REPLICATE)
    usable = np.ones((160, 200), bool)
    stated = noise_left(seen, usable, np.ones((160, 200), np.float32))
    left = (quiet_even_parts(seen, usable) - 0.5)[10:-10, 10:-10].std() / 0.01
    # Stated is the average over where nodes fall between the pixels, not each place's own.
    assert np.median(stated) == pytest.approx(left, rel=0.15)
