"""The noise of an image, found in the image itself."""

import numpy as np
import pytest

from gelpolight_core.base.row_threads import RowThreadPool
from gelpolight_core.image.coded import LightLevels
from gelpolight_core.reconstruction.near_light.image_noise import ImageNoise, image_noise

ROWS, COLUMNS = 240, 320


def measured(light: np.ndarray) -> ImageNoise:
    """Measure an image of 8 bits."""
    raw = np.round(255.0 * np.clip(light, 0.0, 1.0)).astype(np.uint8)
    levels = LightLevels(None)(raw.dtype, False)
    return image_noise(raw, levels, RowThreadPool(2))


def scene() -> np.ndarray:
    """Return smooth light from dark to bright, with a step and a few specks."""
    light = np.tile(np.linspace(0.05, 0.9, COLUMNS), (ROWS, 1))
    light[60:120, 100:180] *= 0.6
    light[::40, ::37] *= 0.3
    return np.repeat(light[..., None], 3, axis=2)


@pytest.mark.parametrize(("shot", "read"), [(4e-5, 0.0015), (4e-4, 0.005)])
def test_noise_is_found_at_every_brightness(shot, read):
    light, random = scene(), np.random.default_rng(0)
    sd = np.sqrt(shot * light + read**2)
    seen = light + sd * random.normal(size=light.shape)
    # Rounding to 8 bits adds its own twelfth of a step squared.
    expected = np.sqrt(sd**2 + 1.0 / 12.0 / 255.0**2)
    at = np.moveaxis(light, -1, 0).astype(np.float32)
    found = np.moveaxis(np.sqrt(measured(seen).at(at)), 0, -1)
    middle = (light > 0.15) & (light < 0.8)
    # 64 differences in each of some 35 blocks of like brightness: 3 %; the classes are broad.
    assert np.median(found[middle] / expected[middle]) == pytest.approx(1.0, abs=0.04)
    assert np.abs(found[middle] / expected[middle] - 1.0).max() < 0.2
