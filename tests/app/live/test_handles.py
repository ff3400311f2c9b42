"""Handles follow the mouse and stay in the image."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.live.overlay import ImageOverlay, OverlayCircle
from app.live.overlay_item import OverlayItem

SIZE = (640, 480)
BALL = OverlayCircle(200.0, 100.0, 40.0, "good", handle="ball")

pixels = st.floats(-2000.0, 2000.0)


@pytest.fixture(scope="module")
def item(qapp):
    """Return the overlay of an image."""
    return OverlayItem()


@given(by_u=pixels, by_v=pixels)
def test_a_dragged_centre_follows_the_mouse_and_stays_in_the_image(item, by_u, by_v):
    item.set_overlay(ImageOverlay(circles=(BALL,)), SIZE)
    item.on_drag(item.handles[0].moved(by_u, by_v), ended=True)
    (ball,) = item.handles
    assert 0.0 <= ball.at[0] <= SIZE[0] - 1
    assert 0.0 <= ball.at[1] <= SIZE[1] - 1
    assert ball.radius == BALL.radius_px
    if 0.0 <= BALL.u + by_u <= SIZE[0] - 1:
        assert ball.at[0] == pytest.approx(BALL.u + by_u)
