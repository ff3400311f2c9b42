"""Roughness of a profile, against the formulas of the standards."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from maps import made, stated

from gelpolight_core.errors import InputError
from gelpolight_core.measurement.profile import Profile, take_profile
from gelpolight_core.measurement.profile_roughness import (
    SECTIONS,
    gaussian_mean_line,
    profile_roughness,
)

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
def test_a_short_wave_has_the_parameters_of_a_sine(slope: float) -> None:
    found = profile_roughness(wave(0.4, slope=slope), cutoff_mm=CUTOFF_MM)
    share = passed_by_standard(0.4)
    assert found.sections == SECTIONS
    assert found.ra.value == pytest.approx(share * 2e3 * AMPLITUDE_MM / math.pi, rel=0.02)
    assert found.rq.value == pytest.approx(share * 1e3 * AMPLITUDE_MM / math.sqrt(2.0), rel=0.02)
    assert found.rz.value == pytest.approx(share * 2e3 * AMPLITUDE_MM, rel=0.02)


@pytest.mark.parametrize("length_mm", [0.4, 0.8, 1.6])
def test_the_filter_passes_what_the_standard_says(length_mm: float) -> None:
    """Half of a wave as long as the cut-off."""
    step = 0.01
    x = np.arange(4000) * step
    z = np.sin(2.0 * np.pi * x / length_mm)
    rough = z - gaussian_mean_line(z, step, CUTOFF_MM)
    middle = rough[1000:3000]
    assert np.ptp(middle) / 2.0 == pytest.approx(passed_by_standard(length_mm), abs=0.002)


def test_a_map_with_errors_gives_the_parameters_theirs() -> None:
    clean = profile_roughness(wave(0.4))
    noisy = profile_roughness(wave(0.4, **stated(40, 1e-3)))
    assert clean.ra.sd is None
    assert 0.0 < noisy.ra.sd < 0.2 * noisy.ra.value


def test_a_line_that_is_too_short_or_has_gaps_is_refused() -> None:
    profile = wave(0.4)
    with pytest.raises(InputError, match="too short for a cut-off"):
        profile_roughness(profile, cutoff_mm=float(profile.along_mm[-1]))
    with pytest.raises(InputError, match=r"cut-off is 0\.01 mm"):
        profile_roughness(profile, cutoff_mm=0.01)
    profile.depth_mm[profile.depth_mm.size // 2] = np.nan
    with pytest.raises(InputError, match="without depth"):
        profile_roughness(profile)
