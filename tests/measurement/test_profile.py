"""A user draws a line and reads steps and widths off the section."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from maps import PITCH, X, Y, drawn, made, stated

from gelpolight_core.base.errors import InputError
from gelpolight_core.measurement.profile import step_height, take_profile, width_at, width_ends
from gelpolight_core.reconstruction.height_map import Flag


@given(
    angle=st.floats(0.0, 6.28),
    length=st.floats(0.5, 4.0),
    width=st.floats(0.0, 1.0),
    steep=st.floats(-1.0, 1.0),
)
@settings(max_examples=25, deadline=None)
def test_a_line_in_any_direction_reads_a_tilted_plane_as_it_is(angle, length, width, steep):
    plane = made(lambda x, y: 1.0 + steep * x + 0.3 * y)
    end = (1.0 + length * math.cos(angle), -0.5 + length * math.sin(angle))
    profile = take_profile(plane, (1.0, -0.5), end, width_mm=width)
    along = steep * math.cos(angle) + 0.3 * math.sin(angle)
    assert np.diff(profile.along_mm).max() <= PITCH / 2 + 1e-9
    expected = 1.0 + steep - 0.15 + along * profile.along_mm
    assert profile.depth_mm == pytest.approx(expected, abs=2e-6)
    assert profile.points_mm[-1] == pytest.approx(end)


def test_outside_the_map_and_its_working_area_there_is_no_depth():
    profile = take_profile(made(lambda x, y: x), (0.0, -7.0), (0.0, 0.0))
    inside = profile.points_mm[:, 1] >= Y[4]
    assert np.isfinite(profile.depth_mm[inside]).all()
    assert np.isnan(profile.depth_mm[profile.points_mm[:, 1] < Y[3]]).all()
    assert (profile.flags[~inside][1:-4] & int(Flag.OUTSIDE)).all()
    with pytest.raises(InputError, match="outside the working area"):
        take_profile(made(lambda x, y: x), (20.0, 0.0), (30.0, 0.0))


@pytest.mark.function("Measure the width of a profile at any depth")
def test_the_width_of_a_roof_at_a_level_and_at_half_its_height():
    roof = made(lambda x, y: np.maximum(1.0 - np.abs(x - 0.3) / 2.0, 0.0))
    profile = take_profile(roof, (-5.0, 1.0), (5.0, 1.0), width_mm=0.4)
    assert width_at(profile, 0.25).value == pytest.approx(3.0, abs=1e-4)
    assert width_at(profile).value == pytest.approx(2.0, abs=0.01)
    left, right, level = width_ends(profile, 0.25)
    assert (left, right, level) == pytest.approx((3.8, 6.8, 0.25), abs=1e-4)
    with pytest.raises(InputError, match="twice"):
        width_at(profile, 2.0)
    bare = take_profile(made(lambda x, y: 0.0 * x), (-5.0, 1.0), (5.0, 1.0))
    with pytest.raises(InputError, match="flat"):
        width_at(bare)


def test_a_stair_has_its_step():
    profile = take_profile(made(lambda x, y: np.where(x > 0.0, 0.7, 0.2)), (-3, 0), (3, 0))
    step = step_height(profile, first_mm=(0.5, 2.0), second_mm=(4.0, 5.5))
    assert (step.value, step.unit, step.name) == (pytest.approx(0.5, abs=1e-6), "mm", "step_height")


def test_a_step_scatters_by_what_it_states():
    def surface(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return np.maximum(1.0 - np.abs(x) / 2.0, 0.0)

    def step(heightmap):
        p = take_profile(heightmap, (-4.0, 0.3), (4.0, 0.3), width_mm=0.5)
        return step_height(p, first_mm=(0.2, 1.4), second_mm=(3.8, 4.2))

    sigma = 0.01
    x, y = np.meshgrid(X, Y)
    repeats = [step(made(surface(x, y) + drawn(sigma, seed))).value for seed in range(60)]
    # 60 repeats know their scatter to 9 %, 200 examples theirs to 5 %.
    scatter = pytest.approx(np.std(repeats, ddof=1), rel=0.3)
    assert step(made(surface, **stated(200, sigma))).sd == scatter


def test_the_calibrations_share_goes_to_depths_and_to_lengths():
    surface = made(lambda x, y: np.maximum(1.0 - np.abs(x) / 2.0, 0.0), **stated(4, 0.0))
    scaled = replace(surface, depth_scale_sd=0.01, lateral_scale_sd=0.002)
    profile = take_profile(scaled, (-4.0, 0.0), (4.0, 0.0))
    step = step_height(profile, first_mm=(0.2, 1.0), second_mm=(3.9, 4.1))
    assert step.sd == pytest.approx(0.01 * step.value, rel=1e-3)
    width = width_at(profile)
    assert width.sd == pytest.approx(
        math.hypot(0.002 * width.value, math.sqrt(2 / 12) * PITCH), rel=1e-3
    )
    assert profile.depth_sd_mm == pytest.approx(0.01 * profile.depth_mm, abs=1e-9)
