"""Poor figures have one cause, with the step or the number that corrects it."""

from types import SimpleNamespace

import pytest

from app.calibrate.result_step import corrective_action
from gelpolight_core.base.finding import QualityTable, judge
from gelpolight_core.base.root_causes import MODEL
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
