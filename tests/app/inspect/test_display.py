"""Display settings are saved between runs."""

from __future__ import annotations

import pytest
from hypothesis import strategies as st

from app.context.context import AppContext
from app.inspect.display_panel import DisplayPanel
from app.inspect.views import Views
from app.services.jobs import Jobs
from app.view2d.display import COLOUR_MAPS, Display, Light, display_as_text, display_from_text

looks = st.builds(
    Display,
    colours=st.sampled_from(sorted(COLOUR_MAPS)),
    range_mm=st.none() | st.tuples(st.floats(-1.0, 0.5), st.floats(0.6, 5.0)),
    contour_mm=st.floats(0.0, 5.0),
    relief=st.booleans(),
    exaggeration=st.floats(1.0, 8.0),
    light=st.builds(Light, st.floats(0.0, 359.0), st.floats(15.0, 85.0)),
)


@pytest.mark.parametrize(
    "text",
    ["", "nonsense", "{}", '{"colours": "jet"}', display_as_text(Display(colours="jet")), "[1]"],
)
def test_unreadable_display_settings_give_the_default(text: str) -> None:
    assert display_from_text(text) == Display()


def test_the_views_restore_their_display_settings(context: AppContext) -> None:
    chosen = Display("magma", (0.0, 1.5), 0.25, False, 3.0, Light(90.0, 60.0))
    for restored in (False, True):
        jobs = Jobs("look")
        views = Views(jobs, context=context)
        if restored:
            views.restore()
            assert views.display.display == chosen
        else:
            views.display.show_display(chosen)
            views.keep()
        views.finish()
        views.close()
        views.deleteLater()
        jobs.close()


def test_a_panel_shows_the_display_settings_exactly(qapp: object) -> None:
    panel = DisplayPanel()
    display = Display("inferno", None, 0.1, True, 2.0, Light(45.0, 30.0))
    panel.show_display(display)
    assert panel.display == display
    panel.deleteLater()
