"""The noise of a picture, found in the picture itself."""

from __future__ import annotations

import numpy as np
import pytest

from gelpolight_core.reconstruction.picture_noise import picture_noise

ROWS, COLUMNS = 240, 320


def scene() -> np.ndarray:
    """Return smooth light from dark to bright, with a step and a few specks."""
    light = np.tile(np.linspace(0.05, 0.9, COLUMNS), (ROWS, 1))
    light[60:120, 100:180] *= 0.6
    light[::40, ::37] *= 0.3
    return np.repeat(light[..., None], 3, axis=2)


@pytest.mark.parametrize(("shot", "read"), [(4e-5, 0.0015), (4e-4, 0.005)])
def test_noise_is_found_at_every_brightness(shot: float, read: float) -> None:
    light, random = scene(), np.random.default_rng(0)
    sd = np.sqrt(shot * light + read**2)
    seen = np.round(255.0 * np.clip(light + sd * random.normal(size=light.shape), 0, 1)) / 255.0
    # Rounding to 8 bits adds its own twelfth of a step squared.
    expected = np.sqrt(sd**2 + 1.0 / 12.0 / 255.0**2)
    found = np.sqrt(picture_noise(seen.astype(np.float32)).at(light.astype(np.float32)))
    middle = (light > 0.15) & (light < 0.8)
    # 64 differences in each of some 35 blocks of like brightness: 3 %; the classes are broad.
    assert np.median(found[middle] / expected[middle]) == pytest.approx(1.0, abs=0.04)
    assert np.abs(found[middle] / expected[middle] - 1.0).max() < 0.2


@pytest.mark.parametrize("value", [0.0, 1.0, np.nan])
def test_a_picture_without_information_has_a_finite_noise(value: float) -> None:
    noise = picture_noise(np.full((ROWS, COLUMNS, 3), value, np.float32))
    found = noise.at(np.full((4, 4, 3), 0.5, np.float32))
    assert np.isfinite(found).all()
    assert (found >= 0.0).all()
