"""The blur of lens, pixel and sampling is undone where the image is not averaged."""

import cv2
import numpy as np
import pytest

from gelpolight_core.reconstruction.near_light.ratio_sampler import inverse_of_blur


@pytest.mark.parametrize("blur_px", [0.5, 0.75])
@pytest.mark.parametrize("period_px", [8.0, 16.0, 40.0])
def test_a_blurred_wave_gets_its_height_back(blur_px, period_px):
    across = np.cos(2.0 * np.pi * np.arange(400) / period_px)
    wave = np.tile(across, (60, 1)).astype(np.float32)
    # A Gaussian lowers a wave by this much, wherever it lies between the pixels.
    low = wave * np.float32(np.exp(-0.5 * (2.0 * np.pi * blur_px / period_px) ** 2))
    back = cv2.filter2D(low, cv2.CV_32F, inverse_of_blur(blur_px**2))[10:-10, 50:-50]
    assert np.abs(back).max() == pytest.approx(1.0, abs=0.04)
    assert np.abs(low).max() < np.abs(back).max()


def test_even_light_stays_as_it_is():
    assert float(inverse_of_blur(0.5).sum()) == pytest.approx(1.0, abs=1e-6)
