"""Styles, viewpoints and round numbers."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from app.view3d.overlays import round_values
from app.view3d.style import Viewpoint, viewpoints_as_text, viewpoints_from_text


@given(st.floats(-100.0, 100.0), st.floats(1e-3, 100.0), st.integers(3, 11))
def test_values_of_an_axis_are_round_even_and_inside(low, width, most):
    values = round_values(low, low + width, most)
    assert len(values) <= 3 * most
    inside = values[(values > low - 1e-3 * width) & (values < low + width * 1.001)]
    assert len(inside) == len(values) >= 1
    steps = np.diff(values)
    assert np.allclose(steps, steps[:1].repeat(len(steps)))


def test_viewpoints_are_kept_by_name():
    kept = {"coin": Viewpoint((1.0, 2.0, 3.0), (0.0, 0.0, 0.0), (0.0, 1.0, 0.0), True, 4.0)}
    assert viewpoints_from_text(viewpoints_as_text(kept)) == kept
