"""The effect of an edited reflectance table on a real press."""

import numpy as np
import pytest

from gelpolight_core.calibration.edit_effect import ball_effect
from gelpolight_core.calibration.open_ball_stages import REFLECTANCE
from gelpolight_core.calibration.project import assemble
from gelpolight_core.calibration.recipes import FULL


@pytest.mark.function("See what an edited curve does to a known press")
def test_a_wrong_table_changes_the_press(small_project):
    run = assemble(FULL, small_project.session, small_project.results)
    effect = ball_effect(run)
    table = run.results[REFLECTANCE].table.table
    name = run.results[REFLECTANCE].table.presses[0].name
    curve = table.cosines[0], table.values[0]
    bent = curve[1] * (1.0 - 0.2 * np.exp(-(((curve[0] - 0.4) / 0.2) ** 2)))  # on the ball's side
    before, after = effect({0: curve}, name), effect({0: (curve[0], bent)}, name)
    assert after.rms_mm > 1.5 * before.rms_mm
    # The factors follow the curve, so the membrane far from the ball stays flat.
    assert after.profile_mm[[0, -1]] == pytest.approx(before.profile_mm[[0, -1]], abs=0.06)
