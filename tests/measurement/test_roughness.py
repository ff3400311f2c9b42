"""Roughness of a region and of a profile, against the formulas of the standards."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from maps import PITCH, made, stated

from gelpolight_core.base.errors import InputError
from gelpolight_core.measurement.area import Rectangle
from gelpolight_core.measurement.measured_value import MeasuredValue
from gelpolight_core.measurement.profile import Profile, take_profile
from gelpolight_core.measurement.roughness import gaussian_mean_line, profile_roughness, roughness

WAVE_MM = 40 * PITCH
# Whole waves in both directions, no node counted at both ends.
WHOLE = Rectangle((-0.5 * PITCH, -0.5 * PITCH), (3 * WAVE_MM - PITCH, 2 * WAVE_MM - PITCH))


def values(figures: tuple[MeasuredValue, ...]) -> tuple[float, ...]:
    return tuple(figure.value for figure in figures)


@pytest.mark.function("Measure the roughness of an area")
@given(amplitude=st.floats(1e-3, 0.2), tilt_x=st.floats(-0.5, 0.5), tilt_y=st.floats(-0.5, 0.5))
@settings(max_examples=15, deadline=None)
def test_a_sine_has_the_roughness_that_the_standard_gives_it(amplitude, tilt_x, tilt_y):
    def surface(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return amplitude * np.sin(2 * np.pi * y / WAVE_MM) + tilt_x * x + tilt_y * y + 0.4

    level = made(lambda x, y: surface(x, y) - tilt_x * x - tilt_y * y)
    # The least-squares plane of a whole sine leans a little: it is part of the definition.
    plane = values(roughness(level, WHOLE))
    tilted = values(roughness(made(surface), WHOLE))
    assert tilted == pytest.approx(plane, rel=1e-3, abs=2e-3)


def test_a_symmetric_wave_is_not_levelled_away():
    wave = made(lambda x, y: 0.05 * np.cos(2 * np.pi * x / WAVE_MM))
    centred = Rectangle((0.0, 0.0), (2 * WAVE_MM, 1.0))
    sa, sq, sz = values(roughness(wave, centred))
    assert sa == pytest.approx(100.0 / math.pi, rel=0.02)
    assert sq == pytest.approx(50.0 / math.sqrt(2), rel=0.02)
    assert sz == pytest.approx(100.0, rel=1e-3)


def test_a_region_of_a_map_with_errors_has_parameters_with_theirs():
    assert roughness(made(lambda x, y: 0.0 * x), WHOLE)[0].sd is None
    noisy = roughness(made(lambda x, y: 0.0 * x, **stated(64, 0.004)), WHOLE)
    assert [f.name for f in noisy] == ["sa", "sq", "sz"]
    # Bilinear between examples at every fourth node, noise keeps two thirds of itself.
    assert noisy[1].sd == pytest.approx(4.0 * 2 / 3, rel=0.15)
    assert all(f.sd is not None and f.sd > 0.0 and f.unit == "um" for f in noisy)


AMPLITUDE_MM = 0.01
CUTOFF_MM = 0.8


def wave(length_mm: float, *, slope: float = 0.0, **more: object) -> Profile:
    """Return a profile over a wave, on a slope, without the errors of interpolating a map."""
    flat = made(lambda x, y: 0.0 * x, **more)
    profile = take_profile(flat, (-7.5, 0.0), (7.5, 0.0))
    x = profile.along_mm
    depth = AMPLITUDE_MM * np.sin(2.0 * np.pi * x / length_mm) + slope * x
    return replace(profile, depth_mm=depth)


def passed_by_standard(length_mm: float) -> float:
    """Return the share of a wave that counts as roughness (ISO 16610-21, Eq. 3)."""
    return 1.0 - math.exp(-math.log(2.0) * (CUTOFF_MM / length_mm) ** 2)


@pytest.mark.parametrize("slope", [0.0, 0.05])
def test_a_short_wave_has_the_parameters_of_a_sine(slope):
    ra, rq, rz = values(profile_roughness(wave(0.4, slope=slope), cutoff_mm=CUTOFF_MM))
    share = passed_by_standard(0.4)
    assert ra == pytest.approx(share * 2e3 * AMPLITUDE_MM / math.pi, rel=0.02)
    assert rq == pytest.approx(share * 1e3 * AMPLITUDE_MM / math.sqrt(2.0), rel=0.02)
    assert rz == pytest.approx(share * 2e3 * AMPLITUDE_MM, rel=0.02)


@pytest.mark.parametrize("length_mm", [0.4, 0.8, 1.6])
def test_the_filter_passes_what_the_standard_says(length_mm):
    """Half of a wave as long as the cut-off."""
    step = 0.01
    x = np.arange(4000) * step
    z = np.sin(2.0 * np.pi * x / length_mm)
    rough = z - gaussian_mean_line(z, step, CUTOFF_MM)
    middle = rough[1000:3000]
    assert np.ptp(middle) / 2.0 == pytest.approx(passed_by_standard(length_mm), abs=0.002)


def test_a_line_that_is_too_short_or_has_gaps_is_refused():
    profile = wave(0.4)
    with pytest.raises(InputError, match="shorter than two cut-offs"):
        profile_roughness(profile, cutoff_mm=float(profile.along_mm[-1]))
    with pytest.raises(InputError, match=r"cut-off is 0\.01 mm"):
        profile_roughness(profile, cutoff_mm=0.01)
    profile.depth_mm[profile.depth_mm.size // 2] = np.nan
    with pytest.raises(InputError, match="without depth"):
        profile_roughness(profile)
