"""Display settings are saved between runs."""

import pytest

from app.inspect.processing_panel import DisplayPanel
from app.inspect.views import Views
from app.services.jobs import Jobs
from app.view2d.display import Display
from gelpolight_core.fields import as_text, from_text

CHOSEN = Display(
    "magma",
    "slope",
    locked=True,
    low_mm=0.0,
    high_mm=1.5,
    contour_mm=0.25,
    relief=False,
    exaggeration=3.0,
    azimuth_deg=90.0,
    elevation_deg=60.0,
)


@pytest.mark.parametrize(
    "text", ["", "nonsense", "{}", '{"colours": "jet"}', as_text(Display(colours="jet")), "[1]"]
)
def test_unreadable_display_settings_give_the_default(text):
    assert from_text(Display, text) == Display()


def test_the_views_restore_their_display_settings(context):
    def none() -> None: ...

    for restored in (False, True):
        jobs = Jobs("look")
        views = Views(
            jobs, (), (), on_wanted=none, on_pointed=none, on_hold=none, on_save=none,
            context=context,
        )  # fmt: skip
        if restored:
            views.restore()
            assert views.display.value == CHOSEN
        else:
            views.display.show_value(CHOSEN)
            views.keep()
        views.stage.finish()
        views.close()
        views.deleteLater()
        jobs.close()


@pytest.mark.function("Choose colours, light, contours and depth scale")
def test_a_panel_shows_the_display_settings_exactly(qapp):
    panel = DisplayPanel(lambda: None)
    panel.show_value(CHOSEN)
    assert panel.value == CHOSEN
    panel.deleteLater()
