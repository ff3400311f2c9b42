"""The effect of an edited reflectance table on a real press."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from app.calibrate.reflectance import lut_model as model
from app.calibrate.reflectance.lut_effect import ball_effect
from gelpolight_core.calibration.ball_stage import REFLECTANCE
from gelpolight_core.calibration.project import Run


def test_a_wrong_table_changes_the_press(virtual_run: Run, virtual_session: Path) -> None:
    effect = ball_effect(virtual_run)
    start = model.fitted_curves(virtual_run.results[REFLECTANCE].table.table)
    name = virtual_run.results[REFLECTANCE].table.presses[0].name
    curve = model.thin_nodes(start[0])
    index = int(np.argmin(np.abs(np.subtract(curve.cosines, 0.4))))  # on the ball's side
    low, value = curve.values[index - 1 : index + 1]
    curve = model.move_node(curve, index, curve.cosines[index], value - 0.6 * (value - low))
    before, after = effect(start, name), effect(model.with_curve(start, 0, curve), name)
    assert after.rms_mm > 1.5 * before.rms_mm
    # The factors follow the curve, so the membrane far from the ball stays flat.
    assert after.profile_mm[[0, -1]] == pytest.approx(before.profile_mm[[0, -1]], abs=0.06)
