"""What heights will be worth is judged by the tolerance that measurements need."""

import pytest

from gelpolight_core.base.finding import QualityTable, Verdict, judge
from gelpolight_core.calibration.height_limits import (
    FAIL_PERCENT,
    TOLERANCE_PERCENT,
    WARN_PERCENT,
    judged_for,
)

WORTH = judge("depth_sd_percent", "", 1.5, "%", warn=WARN_PERCENT, fail=FAIL_PERCENT)
NEVER_FAILS = judge("joint_direction_percent", "", 1.5, "%", warn=WARN_PERCENT)
OTHER = judge("stated_percent", "", 1.5, "%", warn=WARN_PERCENT, fail=FAIL_PERCENT)


@pytest.mark.function("Set the tolerance of heights in the preferences: the verdict follows it")
@pytest.mark.parametrize(
    ("tolerance_percent", "verdict"),
    [(TOLERANCE_PERCENT, Verdict.PASS), (4.0, Verdict.WARN), (2.0, Verdict.FAIL)],
)
def test_an_expanded_uncertainty_beyond_the_tolerance_fails(tolerance_percent, verdict):
    table = judged_for({"joint": QualityTable((WORTH,))}, tolerance_percent)["joint"]
    assert table.verdict is verdict
    (found,) = table.figures
    assert found.fail_limit == pytest.approx(0.5 * tolerance_percent)


def test_other_figures_keep_their_limits():
    tables = {"joint": QualityTable((NEVER_FAILS, OTHER))}
    never_fails, other = judged_for(tables, 1.0)["joint"].figures
    assert other == OTHER
    assert (never_fails.verdict, never_fails.fail_limit) == (Verdict.WARN, None)
    assert judged_for(tables, TOLERANCE_PERCENT) == tables
