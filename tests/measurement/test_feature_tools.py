"""Pits, scratches and edge radii of surfaces that are known, tilted and not symmetric."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from maps import PITCH, drawn, made, stated
from numpy.typing import NDArray

from gelpolight_core.base.errors import InputError
from gelpolight_core.measurement.area import Rectangle
from gelpolight_core.measurement.tools.feature_tools import EdgeRadiusTool, PitTool, ScratchTool
from gelpolight_core.measurement.tools.outline_tools import CircleTool
from gelpolight_core.reconstruction.height_map import HeightMap

Array = NDArray[np.float64]
CENTRE = (1.3, -0.7)


def tilted(x: Array, y: Array) -> Array:
    return np.asarray(0.6 + 0.03 * x - 0.02 * y)


def round_feature(height_mm: float, diameter_mm: float, **more: object) -> HeightMap:
    """Return a tilted surface with a flat round pit (negative) or bump."""

    def surface(x: Array, y: Array) -> Array:
        inside = np.hypot(x - CENTRE[0], y - CENTRE[1]) < 0.5 * diameter_mm
        return np.asarray(tilted(x, y) + height_mm * inside)

    return made(surface, **more)


@pytest.mark.function("Measure a pit or bump")
@given(
    height=st.sampled_from([-0.2, -0.05, 0.05, 0.3]),
    diameter=st.floats(0.6, 2.4),
    yaw=st.floats(-40.0, 40.0),
)
@settings(max_examples=20)
def test_a_pit_and_a_bump_have_their_height_sign_and_diameter(height, diameter, yaw):
    found = PitTool(Rectangle(CENTRE, (5.0, 4.0), yaw)).apply(round_feature(height, diameter))
    assert found["feature_height"].value == pytest.approx(height, abs=2e-3)
    assert found["diameter"].value == pytest.approx(diameter, abs=PITCH)
    assert (found.verdict == "doubtful") == (height < 0.0)  # the membrane bridges these pits


def test_the_stated_sd_of_a_pit_covers_its_error():
    sigma, errors = 0.004, []
    for seed in range(12):
        smooth = round_feature(0.1, 1.6, **stated(24, sigma))
        noisy = replace(smooth, depth_mm=smooth.depth_mm + drawn(sigma, seed).astype(np.float32))
        found = PitTool(Rectangle(CENTRE, (4.0, 4.0))).apply(noisy)
        sd = found["feature_height"].sd
        assert sd is not None and 0.0 < sd < 0.02
        errors.append((found["feature_height"].value - 0.1) / sd)
    assert math.sqrt(float(np.mean(np.square(errors)))) < 3.0


@pytest.mark.function("Measure a scratch or ridge")
@given(
    height=st.sampled_from([-0.1, 0.15]), width=st.floats(0.4, 1.0), angle=st.floats(-60.0, 60.0)
)
@settings(max_examples=20)
def test_a_scratch_and_a_ridge_have_their_height_and_width(height, width, angle):
    cos, sin = math.cos(math.radians(angle)), math.sin(math.radians(angle))

    def surface(x: Array, y: Array) -> Array:
        across = cos * (x - CENTRE[0]) + sin * (y - CENTRE[1])
        return np.asarray(tilted(x, y) + height * (np.abs(across) < 0.5 * width))

    start = (CENTRE[0] - 1.5 * cos, CENTRE[1] - 1.5 * sin)
    end = (CENTRE[0] + 1.5 * cos, CENTRE[1] + 1.5 * sin)
    found = ScratchTool(start, end).apply(made(surface))
    assert found["feature_height"].value == pytest.approx(height, rel=0.03)
    assert found["width"].value == pytest.approx(width, abs=1.5 * PITCH)
    assert (found.verdict == "doubtful") == (height < 0.0)


@pytest.mark.function("Measure the radius of an edge")
@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("radius", [0.8, 2.0])
def test_the_radius_of_an_edge_and_of_a_groove(radius, sign):
    def surface(x: Array, y: Array) -> Array:
        along = np.clip(x - CENTRE[0], -0.9 * radius, 0.9 * radius)
        return np.asarray(1.0 + sign * np.sqrt(radius**2 - along**2))

    reach = 0.7 * radius
    tool = EdgeRadiusTool((CENTRE[0] - reach, 0.4), (CENTRE[0] + reach, 0.4))
    found = tool.apply(made(surface))
    assert found["radius"].value == pytest.approx(radius, rel=0.01)
    assert found["arc"].value == pytest.approx(2.0 * math.degrees(math.asin(0.7)), abs=3.0)
    assert found.verdict == "ok"


def test_a_short_arc_is_doubtful():
    def surface(x: Array, y: Array) -> Array:
        return np.asarray(np.sqrt(25.0 - np.clip(x - 1.0, -4.0, 4.0) ** 2) - 4.0)

    found = EdgeRadiusTool((0.0, 0.0), (2.0, 0.0)).apply(made(surface))
    assert found.verdict == "doubtful"


def test_a_section_that_leaves_the_working_area_is_refused():
    for tool in (ScratchTool((0.0, 0.0), (0.0, -5.95)), EdgeRadiusTool((0.0, 0.0), (0.0, -5.95))):
        with pytest.raises(InputError):
            tool.apply(made(tilted))


def test_the_circle_tool_measures_a_hole_in_a_plate():
    def surface(x: Array, y: Array) -> Array:
        away = np.hypot(x - CENTRE[0], y - CENTRE[1])
        return np.asarray(0.6 + 0.2 / (1.0 + np.exp(-(away - 1.5) / 0.02)))

    points = ((2.7, -0.6), (1.2, 0.7), (0.0, -1.2))
    found = CircleTool(points).apply(made(surface))
    assert found["diameter"].value == pytest.approx(3.0, abs=4.0 * PITCH)
    assert found["centre_x"].value == pytest.approx(CENTRE[0], abs=0.03)
