"""What a rule that skips work changes, as the documentation states it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gelpolight_core.reconstruction.near_light.settings import SETTINGS
from gelpolight_core.reconstruction.near_light.solver import NearLightSolver
from gelpolight_core.reconstruction.solver import Wanted
from gelpolight_core.reconstruction.trace import EFFORTS
from gelpolight_core.simulation.indenters import Cylinder
from gelpolight_core.studies.known_sensor import known_sensor, matt_design

EVERYWHERE, SECOND_ROUND, SETTLED = {}, {"shallow_mm": 0.0}, {"settled": 0.0}


@pytest.mark.parametrize(
    ("height_mm", "without", "bound_um"),
    [(0.0, EVERYWHERE, 30.0), (0.6, EVERYWHERE, 8.0), (0.03, SECOND_ROUND, 1.0), (0.6, SETTLED, 6)],
)
def test_skipped_work_changes_the_depth_by_no_more_than_stated(
    height_mm: float, without: dict[str, float], bound_um: float
) -> None:
    known = known_sensor(matt_design(0.25))
    frame = known.noisy(known.pressed(Cylinder(3.0, height_mm), samples=1).frame)
    settings = {effort: replace(SETTINGS[effort], **without) for effort in EFFORTS}
    usual_solver, other_solver = (
        NearLightSolver(known.calibration, workers=2, settings=s) for s in (SETTINGS, settings)
    )
    for effort in EFFORTS:
        wanted = Wanted(effort, normals=False)
        usual = usual_solver.depth(frame, wanted).depth_mm
        wanted = replace(wanted, everywhere=without is EVERYWHERE)
        other = other_solver.depth(frame, wanted).depth_mm
        assert 1e3 * np.abs(usual - other).max() < bound_um
