"""Handles follow the mouse and stay in the image."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.live.overlay import Circle, drag

SIZE = (640, 480)
BALL = Circle(200.0, 100.0, 40.0, "good", handle="ball")

pixels = st.floats(-2000.0, 2000.0)


@given(pixels, pixels, pixels, pixels)
def test_a_dragged_centre_follows_the_mouse_and_stays_in_the_image(u, v, to_u, to_v):
    moved = drag(BALL, False, (u, v), (to_u, to_v), SIZE)
    assert 0.0 <= moved.u <= SIZE[0] - 1
    assert 0.0 <= moved.v <= SIZE[1] - 1
    assert moved.radius_px == BALL.radius_px
    if 0.0 <= BALL.u + to_u - u <= SIZE[0] - 1:
        assert moved.u == pytest.approx(BALL.u + to_u - u)
