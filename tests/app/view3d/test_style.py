"""Styles, viewpoints and round numbers."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.view3d.style import (
    Viewpoint,
    ticks,
    viewpoints_as_text,
    viewpoints_from_text,
)


@given(st.floats(-100.0, 100.0), st.floats(1e-3, 100.0), st.integers(3, 11))
def test_ticks_are_even_few_and_hold_the_range(low: float, width: float, most: int) -> None:
    values = ticks(low, low + width, most)
    assert 2 <= len(values) <= most
    assert values[0] <= low + 1e-6 * width and values[-1] >= low + width * (1.0 - 1e-6)
    steps = [b - a for a, b in itertools.pairwise(values)]
    assert max(steps) == pytest.approx(min(steps))


def test_viewpoints_are_kept_by_name() -> None:
    kept = {"coin": Viewpoint((1.0, 2.0, 3.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), True, 4.0)}
    assert viewpoints_from_text(viewpoints_as_text(kept)) == kept
