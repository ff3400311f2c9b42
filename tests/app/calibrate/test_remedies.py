"""Poor figures have one cause, with the step or the number that mends it."""

from types import SimpleNamespace

import pytest

from app.calibrate.result import mend_of
from gelpolight_core.calibration.ball_stage import REFLECTANCE
from gelpolight_core.calibration.recipe import Results
from gelpolight_core.causes import MODEL
from gelpolight_core.finding import QualityTable, judge
from gelpolight_core.reflectance.agreement import PressAgreement, agreement_figures

NONE = Results()


def poor(*keys: str) -> QualityTable:
    """Return a table of figures that fail."""
    return QualityTable(tuple(judge(k, k, 2.0, fail=1.0, remedy="Coat it again") for k in keys))


def test_a_number_of_the_set_up_is_mended_in_the_set_up():
    mend = mend_of({"reflectance": poor(*MODEL)}, NONE)
    assert (mend.step, mend.ball) == ("setup", "")
    assert "LED height" in mend.text


def test_a_single_poor_figure_is_mended_in_its_step():
    mend = mend_of({"lens": QualityTable(), "top_pose": poor("tilt_deg")}, NONE)
    assert mend.step == "top_pose"
    assert mend_of({"lens": QualityTable()}, NONE) is None


@pytest.mark.function("Mend the one cause of poor figures with a button")
def test_a_ball_that_contradicts_the_others_is_named_with_the_diameter_that_fits():
    good = [PressAgreement(f"balls/ball_{k}.png", 2.0, 2.01, 0.0, 0.01, 0.0) for k in range(4)]
    odd = PressAgreement("balls/ball_012.png", 4.0, 1.9, 0.0, 0.2, 0.0)
    table = QualityTable(agreement_figures((*good, odd)))
    made = SimpleNamespace(table=SimpleNamespace(agreements=(*good, odd)))
    mend = mend_of({"reflectance": table}, NONE.having(REFLECTANCE, made))
    assert (mend.step, mend.ball, mend.diameter_mm) == ("balls", "ball_012.png", 3.8)
    assert "8 mm" in mend.text and "3.8 mm" in mend.text
