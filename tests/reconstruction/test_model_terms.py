"""Each term of a frame's reconstruction, left out: what it is there for then goes wrong."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from gelpolight_core.lab.depth_score import DepthScore, read_true_depth, score_depth
from gelpolight_core.reconstruction.model_terms import ModelTerms
from gelpolight_core.reconstruction.near_light.solver import NearLightSolver
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.reconstruction.solver import DepthSolution, SolveRequest
from gelpolight_core.sensor.sensor_calibration import Calibration
from gelpolight_core.session.session_images import read_linear_image

Map = NDArray[np.float32]
NAME = "cylinder_s4_d150"  # deep, with steep walls and shadows


@pytest.fixture(scope="module")
def rgb(small_session):
    return read_linear_image(small_session / "presses" / f"{NAME}.png").rgb


@pytest.fixture(scope="module")
def whole(rgb, small_calibration):
    """Return the press with all terms on."""
    return solved(rgb, small_calibration)


def solved(rgb: Map, calibration: Calibration, **left_out: bool | int) -> DepthSolution:
    wanted = SolveRequest(terms=ModelTerms(**left_out))
    return NearLightSolver(calibration.data, workers=2).depth(rgb, wanted)


def scored(result: DepthSolution, calibration: Calibration, session: Path) -> DepthScore:
    grid = calibration.table.grid
    truth = read_true_depth(session / "truth" / f"{NAME}.npz")
    return score_depth(result.depth_mm, grid.x_mm, grid.y_mm, truth, height_mm=1.5, radius_mm=12.0)


def test_all_terms_on_is_the_default_to_the_last_bit(rgb, whole, small_calibration):
    default = Reconstructor(small_calibration).depth(rgb)
    for name in ("depth_mm", "normals", "flags"):
        np.testing.assert_array_equal(getattr(default, name), getattr(whole, name))


def test_light_frozen_at_the_flat_membrane_makes_the_press_too_high(
    rgb, whole, small_calibration, small_session
):
    """PHYSICS: nearer light is brighter, by several percent of a depth of 1.5 mm."""
    frozen = solved(rgb, small_calibration, near_light_rounds=0)
    (rounds,) = (step.reason for step in frozen.trace.steps if "quarter scale" in step.name)
    assert "rounds: 0" in rounds
    error = scored(frozen, small_calibration, small_session).height_percent
    best = scored(whole, small_calibration, small_session).height_percent
    assert abs(error) > abs(best) + 1.0
