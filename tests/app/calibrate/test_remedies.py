"""Poor figures have one cause, with the step or the number that corrects it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import scene

from app.calibrate.result_step import (
    changes_since,
    corrective_action,
    last_calibration,
    terms_markup,
)
from app.program.workspace import Workspace
from gelpolight_core.base.finding import QualityTable, judge
from gelpolight_core.base.root_causes import MODEL
from gelpolight_core.calibration.closed_sensor.press_sizes import PressSize
from gelpolight_core.calibration.closed_sensor_recipe import BALLS as CLOSED_BALLS
from gelpolight_core.calibration.joint_stage import term_facts
from gelpolight_core.calibration.open_ball_stages import REFLECTANCE
from gelpolight_core.calibration.recipe import StageResults
from gelpolight_core.stages.balls.press_agreement import PressAgreement, agreement_figures

NONE = StageResults()


def poor(*keys: str) -> QualityTable:
    """Return a table of figures that fail."""
    return QualityTable(tuple(judge(k, k, 2.0, fail=1.0, remedy="Coat it again") for k in keys))


def test_a_number_of_the_set_up_is_corrected_in_the_set_up():
    mend = corrective_action({"reflectance": poor(*MODEL)}, NONE)
    assert (mend.step, mend.ball) == ("setup", "")
    assert "LED height" in mend.text


def test_a_single_poor_figure_is_corrected_in_its_step():
    mend = corrective_action({"lens": QualityTable(), "top_pose": poor("tilt_deg")}, NONE)
    assert mend.step == "top_pose"
    assert corrective_action({"lens": QualityTable()}, NONE) is None


@pytest.mark.function("Mend the one cause of poor figures with a button")
def test_a_ball_that_contradicts_the_others_is_named_with_the_diameter_that_fits():
    good = [PressAgreement(f"balls/ball_{k}.png", 2.0, 2.01, 0.0, 0.01, 0.0) for k in range(4)]
    odd = PressAgreement("balls/ball_012.png", 4.0, 1.9, 0.0, 0.2, 0.0)
    table = QualityTable(agreement_figures((*good, odd)))
    made = SimpleNamespace(table=SimpleNamespace(agreements=(*good, odd)))
    mend = corrective_action({"reflectance": table}, NONE.having(REFLECTANCE, made))
    assert (mend.step, mend.ball, mend.diameter_mm) == ("balls", "ball_012.png", 3.8)
    assert "8 mm" in mend.text and "3.8 mm" in mend.text


def test_on_a_closed_sensor_the_ball_that_contradicts_the_others_gets_its_diameter_too():
    odd = PressSize("ball_05.png", 9.5, 12.5, 12.7, 0.02)
    refused = PressSize("ball_09.png", 2.0, 12.5, 12.7, 0.02)
    made = SimpleNamespace(sizes=(odd, refused), result=SimpleNamespace(refused={refused.name: 1}))
    quality = {"balls": QualityTable((odd.figure,))}
    mend = corrective_action(quality, NONE.having(CLOSED_BALLS, made))
    assert (mend.step, mend.ball, mend.diameter_mm) == ("balls", "ball_05.png", 12.7)


@pytest.mark.function("Compare a calibration with the sensor's last one")
def test_leds_and_light_are_compared_with_those_of_the_last_calibration():
    now = scene.full_calibration()
    full = now.data.full
    moved = replace(full, led_positions_mm=full.led_positions_mm + np.array([0.0, 0.003, 0.004]))
    last = now.changed(full=replace(moved, background=full.background / 0.996))
    assert list(changes_since(last, now)) == ["LEDs within 0.005 mm", "light -0.4 %"]


def test_only_a_usable_calibration_of_the_same_sensor_is_compared(tmp_path):
    now, workspace = scene.full_calibration(), Workspace(tmp_path / "workspace")

    def keep(name: str, day: int, error_percent: float, serial: str = now.serial) -> None:
        figure = judge("ball_height_error_percent", "E", error_percent, "%", warn=2.0, fail=4.0)
        made = replace(now.provenance, created=f"2026-03-{day:02}T12:00:00+00:00", inputs=name)
        sensor = replace(now.data.sensor, serial=serial)
        c = replace(now.changed(sensor=sensor), provenance=made)
        c = replace(c, quality={"joint": QualityTable((figure,))})
        workspace.keep_calibration(c, name)

    assert last_calibration(now, workspace) == ""
    keep("usable", 1, 0.25)
    keep("draft", 2, 9.0)
    keep("another", 3, 0.5, serial="other")
    assert "0.25 %, LEDs within 0.000 mm" in last_calibration(now, workspace)


@pytest.mark.function("See what each term of the light is worth")
def test_terms_that_are_needed_come_before_those_that_are_left_out():
    worth = {"lobe": 0.0004, "gloss": 0.0231, "curves": 0.011}
    full = replace(scene.full_calibration().data.full, worth=worth)
    full = replace(full, membrane_sd={**full.membrane_sd, "curve_0.2_red": 0.01})
    markup = terms_markup(term_facts(full))
    needed, left_out = markup.split("Left out")
    assert "2.3 %" in needed and "0.21" in needed and "1.1 %" in needed
    assert "&lt; 0.1 %" in left_out
