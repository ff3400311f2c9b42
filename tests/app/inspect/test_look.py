"""How depth is shown, kept between starts."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.inspect.banner import Banner
from app.inspect.look import COLOUR_MAPS, Light, Look, look_as_text, look_from_text
from app.inspect.look_panel import LookPanel
from app.inspect.views import Views
from app.shell.context import AppContext
from app.shell.jobs import Jobs

looks = st.builds(
    Look,
    colours=st.sampled_from(sorted(COLOUR_MAPS)),
    range_mm=st.none() | st.tuples(st.floats(-1.0, 0.5), st.floats(0.6, 5.0)),
    contour_mm=st.floats(0.0, 5.0),
    relief=st.booleans(),
    exaggeration=st.floats(1.0, 8.0),
    light=st.builds(Light, st.floats(0.0, 359.0), st.floats(15.0, 85.0)),
)


@given(looks)
def test_a_look_is_read_as_it_was_written(look: Look) -> None:
    assert look_from_text(look_as_text(look)) == look


@pytest.mark.parametrize(
    "text", ["", "nonsense", "{}", '{"colours": "jet"}', look_as_text(Look(colours="jet")), "[1]"]
)
def test_what_cannot_be_read_is_the_usual_look(text: str) -> None:
    assert look_from_text(text) == Look()


def test_the_views_show_depth_as_they_did_when_the_program_was_left(context: AppContext) -> None:
    chosen = Look("magma", (0.0, 1.5), 0.25, False, 3.0, Light(90.0, 60.0))
    for restored in (False, True):
        jobs = Jobs("look")
        views = Views(jobs, context=context)
        if restored:
            views.restore()
            assert views.look.look == chosen
        else:
            views.look.show_look(chosen)
            views.keep()
        views.finish()
        views.close()
        views.deleteLater()
        jobs.close()


def test_the_banner_has_the_same_room_with_and_without_words(qapp: object) -> None:
    banner = Banner("Quiet.")
    height = banner.height()
    banner.advise("Do this.\nAnd that.", ("act", "Do it"), role="warn")
    assert banner.height() == height
    banner.show_work("Working", 0.5)
    assert banner.height() == height
    banner.deleteLater()


def test_a_panel_shows_a_look_as_it_is(qapp: object) -> None:
    panel = LookPanel()
    look = Look("inferno", None, 0.1, True, 2.0, Light(45.0, 30.0))
    panel.show_look(look)
    assert panel.look == look
    panel.deleteLater()
