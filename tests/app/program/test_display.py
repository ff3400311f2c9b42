"""Display settings are saved between runs."""

import json
from dataclasses import asdict, replace

import numpy as np
import pytest

from app.calibrate.image_panels import led_panels
from app.inspect.processing_panel import DisplayPanel
from app.program.display import IN_3D, KEY, DisplaySettings, DisplayStore
from app.views.map.colour_tables import colour_table
from gelpolight_core.base.form_fields import from_settings_text, to_settings_text
from gelpolight_core.output.report.drawing_tools import colour_map

CHOSEN = DisplaySettings(
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
    "text",
    [
        "",
        "nonsense",
        "{}",
        '{"colours": "jet"}',
        to_settings_text(DisplaySettings(colours="jet")),
        "[1]",
    ],
)
def test_unreadable_display_settings_give_the_default(text):
    assert from_settings_text(DisplaySettings, text) == DisplaySettings()


def test_display_settings_are_kept_between_runs_also_those_of_earlier_programs(context):
    settings = context.settings
    context.display.change(**asdict(CHOSEN))
    assert DisplayStore(settings).value == CHOSEN
    settings.keep_display(KEY, "")
    earlier = {name: value for name, value in asdict(CHOSEN).items() if name not in IN_3D}
    settings.keep_display("look", json.dumps(earlier))
    settings.keep_display("view3d", json.dumps({"exaggeration": 5.0, "scale_bar": True}))
    assert DisplayStore(settings).value == replace(CHOSEN, scale_bar=True)


@pytest.mark.function("See Measure, the wizard and reports in the chosen colours")
def test_the_wizard_and_reports_have_the_chosen_colours(small_calibration):
    data, table = small_calibration.data, colour_table("CET-L1")
    lit_mask = data.radiance.min(axis=2) > 0.0
    panels = led_panels(
        data.radiance, lit_mask, data.table.grid, "Light", DisplaySettings(colours="CET-L1")
    )
    for panel in panels:
        assert panel.scale[0] == "CET-L1"
        assert np.ptp(panel.rgb[lit_mask].astype(int), axis=1).max() <= 1  # grey
    assert np.array_equal(np.round(255.0 * colour_map(table)(range(256)))[:, :3], table)


@pytest.mark.function("Choose colours, light, contours and depth scale")
def test_a_panel_shows_and_changes_the_display_settings(context):
    panel = DisplayPanel(context.display)
    context.display.change(**asdict(CHOSEN))
    assert panel.value == CHOSEN
    colours = panel.inputs["colours"]
    colours.setCurrentIndex(colours.findData("inferno"))
    assert context.display.value == replace(CHOSEN, colours="inferno")
    panel.unlock_range()
    panel.show_range(0.1, 0.4)
    panel.toggle_lock()
    assert context.display.value.range_mm == (0.1, 0.4)
    panel.deleteLater()
