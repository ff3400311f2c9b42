"""What a rule that skips work changes, as the documentation states it."""

from dataclasses import replace

import known_press
import numpy as np
import pytest

from gelpolight_core.reconstruction.near_light.effort_parameters import SETTINGS
from gelpolight_core.reconstruction.near_light.solver import NearLightSolver
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.reconstruction.solver import SolveRequest
from gelpolight_core.reconstruction.trace import EFFORTS
from gelpolight_core.simulation.indenters import CylinderIndenter
from gelpolight_core.studies.exact_sensor import matt_design

EVERYWHERE, SECOND_ROUND, SETTLED = {}, {"shallow_mm": 0.0}, {"settled": 0.0}


@pytest.mark.parametrize(
    ("height_mm", "without", "bound_um"),
    [(0.0, EVERYWHERE, 30.0), (0.6, EVERYWHERE, 8.0), (0.03, SECOND_ROUND, 1.0), (0.6, SETTLED, 6)],
)
def test_skipped_work_changes_the_depth_by_no_more_than_stated(height_mm, without, bound_um):
    known = known_press.known_sensor(matt_design(0.25))
    frame = known.noisy(known_press.on(known, CylinderIndenter(3.0, height_mm)).frame)
    settings = {effort: replace(SETTINGS[effort], **without) for effort in EFFORTS}
    usual_solver, other_solver = (
        NearLightSolver(known.calibration.data, workers=2, settings=s) for s in (SETTINGS, settings)
    )
    for effort in EFFORTS:
        wanted = SolveRequest(effort, normals=False)
        usual = usual_solver.depth(frame, wanted).depth_mm
        wanted = replace(wanted, everywhere=without is EVERYWHERE)
        other = other_solver.depth(frame, wanted).depth_mm
        assert 1e3 * np.abs(usual - other).max() < bound_um


@pytest.mark.function("See that an untouched image is not solved")
@pytest.mark.parametrize(("share", "pressed"), [(0.0, False), (1.0, True)])
def test_the_papers_model_leaves_out_an_untouched_image_and_no_visible_press(share, pressed):
    known = known_press.known_sensor(matt_design(0.25))
    visible_mm = Reconstructor(known.calibration).visible_depth_mm
    assert visible_mm is not None
    frame = known.noisy(
        known_press.on(known, CylinderIndenter(4.0, share * visible_mm)).frame, seed=1
    )
    reconstruct = Reconstructor(known.calibration, model="paper")
    height_map = reconstruct.depth(frame)
    assert ("integration" in height_map.trace.done) is pressed
    assert ("integration" in reconstruct.needs(frame).done) is pressed
    assert bool(height_map.depth_mm.any()) is pressed
    assert height_map.depth_mm.max() == pytest.approx(share * visible_mm, abs=0.015)


@pytest.mark.parametrize(("noise", "done"), [(0.001, False), (0.03, True)])
def test_half_scale_is_denoised_only_where_its_nodes_are_noisy(noise, done):
    known = known_press.known_sensor(matt_design(0.25))
    data = replace(known.calibration.data, noise=np.full(3, noise))
    frame = known.noisy(known_press.on(known, CylinderIndenter(3.0, 0.6)).frame)
    solved = NearLightSolver(data, workers=2).depth(frame, SolveRequest("balanced"))
    assert ("denoising" not in solved.trace.skipped_names) is done
