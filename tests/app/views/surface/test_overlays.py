"""The numbers on the axes of the 3D view."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from app.views.surface.overlays import round_values


@given(st.floats(-100.0, 100.0), st.floats(1e-3, 100.0), st.integers(3, 11))
def test_values_of_an_axis_are_round_even_and_inside(low, width, most):
    values = round_values(low, low + width, most)
    assert len(values) <= 3 * most
    inside = values[(values > low - 1e-3 * width) & (values < low + width * 1.001)]
    assert len(inside) == len(values) >= 1
    steps = np.diff(values)
    assert np.allclose(steps, steps[:1].repeat(len(steps)))
