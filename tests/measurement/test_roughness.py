"""A user marks a region and reads its roughness."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from maps import PITCH, made, stated

from gelpolight_core.measurement.area import Rectangle
from gelpolight_core.measurement.roughness import roughness

WAVE_MM = 40 * PITCH
# Whole waves in both directions, no node counted at both ends.
WHOLE = Rectangle((-0.5 * PITCH, -0.5 * PITCH), (3 * WAVE_MM - PITCH, 2 * WAVE_MM - PITCH))


@given(amplitude=st.floats(1e-3, 0.2), tilt_x=st.floats(-0.5, 0.5), tilt_y=st.floats(-0.5, 0.5))
@settings(max_examples=15, deadline=None)
def test_a_sine_has_the_roughness_that_the_standard_gives_it(
    amplitude: float, tilt_x: float, tilt_y: float
) -> None:
    def surface(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return amplitude * np.sin(2 * np.pi * y / WAVE_MM) + tilt_x * x + tilt_y * y + 0.4

    level = made(lambda x, y: surface(x, y) - tilt_x * x - tilt_y * y)
    found = roughness(level, WHOLE, levelled="none")
    assert found.sa_um == pytest.approx(1e3 * 2 * amplitude / math.pi, rel=3e-3)
    assert found.sq_um == pytest.approx(1e3 * amplitude / math.sqrt(2), rel=1e-4)
    assert found.sz_um == pytest.approx(1e3 * 2 * amplitude, rel=1e-4)
    # The least-squares plane of a whole sine leans a little: it is part of the definition.
    plane = roughness(level, WHOLE)
    tilted = roughness(made(surface), WHOLE)
    for name in ("sa_um", "sq_um", "sz_um"):
        assert getattr(tilted, name) == pytest.approx(getattr(plane, name), rel=1e-3, abs=2e-3)
    assert tilted.count == 120 * 80


def test_a_symmetric_wave_is_not_levelled_away() -> None:
    wave = made(lambda x, y: 0.05 * np.cos(2 * np.pi * x / WAVE_MM))
    centred = Rectangle((0.0, 0.0), (2 * WAVE_MM, 1.0))
    found = roughness(wave, centred)
    assert found.levelled == "plane"
    assert found.sq_um == pytest.approx(50.0 / math.sqrt(2), rel=0.02)
    assert found.sa_um == pytest.approx(100.0 / math.pi, rel=0.02)
    assert found.sz_um == pytest.approx(100.0, rel=1e-3)


def test_a_region_says_how_much_of_its_roughness_may_be_the_maps_own() -> None:
    assert roughness(made(lambda x, y: 0.0 * x), WHOLE).sd_um is None
    noisy = roughness(made(lambda x, y: 0.0 * x, **stated(64, 0.004)), WHOLE)
    # Bilinear between examples at every fourth node, noise keeps two thirds of itself.
    assert noisy.noise_sq_um == pytest.approx(4.0 * 2 / 3, rel=0.15)
    assert [f.name for f in noisy.figures] == ["sa", "sq", "sz"]
    assert all(f.sd is not None and f.sd > 0.0 and f.unit == "um" for f in noisy.figures)
