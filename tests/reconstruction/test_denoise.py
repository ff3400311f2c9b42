"""Averaging before the solve: even parts become quiet, edges stay where and as they are."""

import cv2
import numpy as np
import pytest
from compiled import quiet

from gelpolight_core.reconstruction.near_light.depth_uncertainty import residual_noise_share
from gelpolight_core.reconstruction.near_light.ratio_sampler import inverse_of_blur


def image(noise: float) -> tuple[np.ndarray, np.ndarray]:
    """Return a clean image with a slow slope and one step, and the same with noise."""
    rng = np.random.default_rng(0)
    clean = np.tile(np.linspace(0.4, 0.5, 200), (160, 1))
    clean[:, 120:] += 0.3
    clean = np.repeat(clean[..., None], 3, axis=2)
    return clean, (clean + rng.normal(0, noise, clean.shape)).astype(np.float32)


USABLE = np.ones((160, 200), bool)
ONE = np.ones((160, 200, 3), np.float32)


def quieted(light: np.ndarray, sigma: float = 0.005) -> np.ndarray:
    """Return the averaged ratio over an even background."""
    ratio, _, _ = quiet(light, ONE, np.float32(sigma) * ONE, USABLE)
    return ratio


def test_noise_goes_and_the_step_stays():
    clean, noisy = image(0.01)
    quiet = quieted(noisy)
    even = np.s_[10:-10, 10:100]
    assert (quiet - clean)[even].std() < 0.35 * (noisy - clean)[even].std()
    # The step itself is used as it is: no pixel of it is averaged across.
    np.testing.assert_allclose(quiet[20:140, 118:122], noisy[20:140, 118:122], atol=1e-3)


def test_an_image_without_noise_is_left_alone():
    clean, noisy = image(0.0)
    assert np.abs(quieted(noisy) - clean).max() < 2e-3
    assert quiet(noisy, ONE, np.float32(0.005) * ONE, USABLE)[2] is None


@pytest.mark.parametrize("shift", [0.0, 0.3, 0.5])
def test_the_noise_that_is_left_is_known(shift):
    """Raw noise, resampled between the pixels and quieted, beside what is stated."""
    random = np.random.default_rng(1)
    clean = np.full((160, 200, 3), 0.5, np.float32)
    raw = clean + random.normal(0, 0.01, clean.shape).astype(np.float32)
    move = np.float32([[1, 0, shift], [0, 1, shift]])
    seen = cv2.warpAffine(raw, move, (200, 160), borderMode=cv2.BORDER_REPLICATE)
    _, _, edge = quiet(seen, ONE, np.float32(0.005) * ONE, USABLE)
    one, none = np.ones((160, 200), np.float32), inverse_of_blur(0.0)
    stated = residual_noise_share(edge, one, resampled=1, kernel=none)
    left = (quieted(seen) - 0.5)[10:-10, 10:-10].std() / 0.01
    # Stated is the average over where nodes fall between the pixels, not each place's own.
    assert np.median(stated) == pytest.approx(left, rel=0.15)


@pytest.mark.parametrize("resampled", [1, 2])
def test_the_noise_that_sharpening_makes_is_known(resampled):
    """Averaged over where nodes fall between the pixels."""
    random, kernel = np.random.default_rng(3), inverse_of_blur(0.5)
    found = []
    for _ in range(60):
        seen = random.normal(0.0, 0.01, (120, 120)).astype(np.float32)
        for step in range(resampled):
            move = np.float32([[1, 0, random.random()], [0, 1, random.random()]])
            seen = cv2.warpAffine(seen, move, (120, 120))
            if step == 0:
                seen = cv2.filter2D(seen, cv2.CV_32F, kernel)
        found.append(seen[10:-10, 10:-10].var() / 0.01**2)
    one = np.ones((2, 2), np.float32)
    stated = residual_noise_share(None, one, resampled=resampled, kernel=kernel)
    assert np.sqrt(np.mean(found)) == pytest.approx(float(stated[0, 0]), rel=0.1)


def test_little_light_is_averaged_wider_and_the_light_it_has_is_known():
    """A fortieth of the light: a fifth of the noise of the first average is left, none invented."""
    random = np.random.default_rng(2)
    background = np.full((160, 200, 3), 0.02, np.float32)
    background[:, :100] = 0.8
    press = background + random.normal(0.0, 0.004, background.shape).astype(np.float32)
    sigma = np.float32(0.004) / background
    ratio, left, _ = quiet(press, background, sigma, USABLE)
    dim, bright = np.s_[20:-20, 140:180], np.s_[20:-20, 20:60]
    assert (ratio - 1.0)[dim].std() < 0.25 * 0.2 * 0.25
    assert abs(float(ratio[dim].mean()) - 1.0) < 0.01
    assert (ratio - 1.0)[dim].std() == pytest.approx(float(left[dim].mean()), rel=0.3)
    assert (ratio - 1.0)[bright].std() == pytest.approx(0.005 * 0.235, rel=0.15)


def test_what_lies_outside_of_the_membrane_does_not_darken_its_rim():
    usable = np.zeros((160, 200), bool)
    usable[40:120, 50:150] = True
    background = np.where(usable[..., None], 0.02, 0.01).astype(np.float32) * ONE
    press = np.where(usable[..., None], background, 0.0).astype(np.float32)
    ratio, _, _ = quiet(press, background, 0.2 * ONE, usable)
    np.testing.assert_allclose(ratio[usable], 1.0, atol=1e-3)
