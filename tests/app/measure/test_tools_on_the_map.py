"""Tools that are placed and moved, figures as text, presses that are frozen."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.live.tool_layer import move_handle, tool_handles
from app.measure.measurement_engine import apply_tool
from app.measure.steady_press import SteadyPressDetector
from app.sources.source import SourceFrame
from gelpolight_core.base.compared_quantity import value_text
from gelpolight_core.measurement.tools.tool_placing import first_points, make_tool
from gelpolight_core.measurement.tools.tool_registry import PALETTE, TOOLS
from gelpolight_core.reconstruction.height_map import HeightMap

KINDS = st.sampled_from(list(TOOLS.values()))
PLACES = st.tuples(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0))


@given(kind=KINDS, middle=PLACES, to=PLACES, data=st.data())
def test_a_handle_goes_where_it_is_dragged(kind, middle, to, data):
    tool = make_tool(kind, first_points(kind, middle))
    handle = data.draw(st.sampled_from(tool_handles(tool)))
    after = {g.name: g.at for g in tool_handles(move_handle(tool, handle.name, to))}
    if handle.name.endswith(("corner", "turn")):
        # They stay on the rectangle: one mirrors about the centre, one only rotates.
        assert all(map(math.isfinite, after[handle.name]))
    else:
        assert after[handle.name] == pytest.approx(to)


@given(kind=KINDS, middle=PLACES)
def test_every_tool_of_the_palette_is_placed_with_the_keyboard(kind, middle):
    tool = make_tool(kind, first_points(kind, middle))
    assert type(tool) is kind


def test_every_tool_has_its_own_key_and_asks_for_all_its_points():
    keys = [entry.key for entry in PALETTE.values()]
    assert all(keys) and len(set(keys)) == len(keys)
    for name, entry in PALETTE.items():
        assert len(first_points(TOOLS[name], (0.0, 0.0))) == len(entry.prompts)


@pytest.mark.parametrize("kind", TOOLS.values())
def test_a_tool_that_finds_nothing_answers_with_a_sentence(kind):
    axis, flat = np.linspace(-5.0, 5.0, 41), np.zeros((41, 41), np.float32)
    plane = HeightMap(flat, axis, axis, 0.25, None, flat.astype(np.uint8), "A-1", "full", "p.png")
    outcome = apply_tool(make_tool(kind, first_points(kind, (0.0, 0.0))), plane)
    assert outcome.result is not None or outcome.refused[0].isupper()


@pytest.mark.parametrize(
    ("value", "sd", "unit", "text"),
    [
        (4.98769, 0.02446, "mm", "4.988 ± 0.024 mm"),
        (1.0018, 0.00248, "mm", "1.0018 ± 0.0025 mm"),
        (12.345, 3.21, "deg", "12.3 ± 3.2°"),
        (4.4721, None, "mm", "4.472 mm"),
        (4.4721, 1e-7, "mm", "4.472 ± <0.001 mm"),
        (math.nan, None, "mm", "unknown"),
    ],
)
def test_a_figure_has_no_more_digits_than_its_standard_deviation_allows(value, sd, unit, text):
    assert value_text(value, sd, unit) == text


AXIS = np.arange(-120, 121) / 20.0


def _shown(depth_mm: float, time_s: float, seed: int) -> tuple[SourceFrame, HeightMap]:
    """Return a frame with a round press, and its depth."""
    radius = np.hypot(*np.meshgrid(AXIS, AXIS))
    dome = np.maximum(depth_mm * (1.0 - radius**2 / 9.0), 0.0).astype(np.float32)
    light = 120.0 + 80.0 * np.gradient(dome, axis=1) * 20.0
    noise = np.random.default_rng(seed).standard_normal((*light.shape, 3))
    rgb = np.clip(np.rint(light[..., None] + noise), 0, 255).astype(np.uint8)
    flags = np.zeros_like(dome, np.uint8)
    heightmap = HeightMap(dome, AXIS, AXIS, 0.05, None, flags, "A", "full", "")
    return SourceFrame(rgb, seed, time_s), heightmap


def test_a_press_is_frozen_once_when_steady_and_again_after_it_moved():
    detector = SteadyPressDetector()

    def held(depths: list[float], start_s: float) -> list[bool]:
        shown = (
            _shown(depth, start_s + 0.15 * k, round(100 * start_s) + k)
            for k, depth in enumerate(depths)
        )
        return [detector.update(*one) for one in shown]

    assert not any(held([0.1 * k for k in range(11)], 0.0))
    rest = held([1.0] * 12, 2.0)
    assert rest.count(True) == 1
    assert rest.index(True) < 8
    detector.hold(_shown(1.0, 4.0, 1)[0])
    assert not any(held([1.0] * 8, 4.0)) and not detector.other
    assert not any(held([0.0] * 8, 6.0)) and detector.other
    assert held([0.5] * 8, 8.0).count(True) == 1
