"""Tools that are placed and moved, figures as text, presses that are frozen."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.measure.figures_text import value_text
from app.measure.grips import Point, grips_of, moved
from app.measure.placing import first_points, kinds, make_tool
from app.measure.steady import SteadyPress
from gelpolight_core.measurement.tools import tool_as_dict, tool_from_dict

KINDS = st.sampled_from([kind.name for kind in kinds()])
PLACES = st.tuples(st.floats(-9.0, 9.0), st.floats(-9.0, 9.0))


@given(kind=KINDS, middle=PLACES, to=PLACES, data=st.data())
def test_a_grip_goes_where_it_is_dragged(
    kind: str, middle: Point, to: Point, data: st.DataObject
) -> None:
    tool = make_tool(kind, first_points(kind, middle))
    grip = data.draw(st.sampled_from(grips_of(tool)))
    after = {g.name: g.at_mm for g in grips_of(moved(tool, grip.name, to))}
    if grip.name.endswith(("corner", "turn")):
        # They stay on the rectangle: one mirrors about the centre, one only rotates.
        assert all(map(math.isfinite, after[grip.name]))
    else:
        assert after[grip.name] == pytest.approx(to)


@given(kind=KINDS, middle=PLACES)
def test_every_tool_of_the_palette_is_written_and_read_as_the_command_line_does(
    kind: str, middle: Point
) -> None:
    tool = make_tool(kind, first_points(kind, middle))
    assert tool.name == kind
    assert tool_from_dict(tool_as_dict(tool)) == tool


def test_every_tool_has_its_own_key_and_asks_for_all_its_points() -> None:
    keys = [kind.key for kind in kinds()]
    assert len(set(keys)) == len(keys)
    for kind in kinds():
        assert len(first_points(kind.name, (0.0, 0.0))) == len(kind.asks)


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
def test_a_figure_has_no_more_digits_than_its_standard_deviation_allows(
    value: float, sd: float | None, unit: str, text: str
) -> None:
    assert value_text(value, sd, unit) == text


def _dome(depth_mm: float) -> np.ndarray:
    y, x = np.mgrid[-120:121, -120:121] / 20.0
    return np.maximum(depth_mm * (1.0 - (x**2 + y**2) / 9.0), 0.0).astype(np.float32)


def test_a_press_is_frozen_once_when_steady_and_again_after_it_moved() -> None:
    watch = SteadyPress()
    held = [watch.update(_dome(0.1 * k), 0.03 * k) for k in range(11)]
    assert not any(held)
    rest = [watch.update(_dome(1.0), 0.4 + 0.05 * k) for k in range(40)]
    assert rest.count(True) == 1
    assert 0.3 <= 0.05 * rest.index(True) <= 0.6
    watch.update(_dome(0.5), 3.0)
    again = [watch.update(_dome(0.5), 3.1 + 0.05 * k) for k in range(40)]
    assert again.count(True) == 1
