"""Each term of a frame's reconstruction, left out: what it is there for then goes wrong."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from gelpolight_core.lab.depth_score import DepthScore, read_true_depth, score_depth
from gelpolight_core.reconstruction.near_light import solver as near_light
from gelpolight_core.reconstruction.near_light.solver import NearLightSolver
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


def solved(rgb: Map, calibration: Calibration) -> DepthSolution:
    return NearLightSolver(calibration.data, workers=2).depth(rgb, SolveRequest())


def scored(result: DepthSolution, calibration: Calibration, session: Path) -> DepthScore:
    grid = calibration.table.grid
    truth = read_true_depth(session / "truth" / f"{NAME}.npz")
    return score_depth(result.depth_mm, grid.x_mm, grid.y_mm, truth, height_mm=1.5, radius_mm=12.0)


def test_light_frozen_at_the_flat_membrane_makes_the_press_too_high(
    rgb, whole, small_calibration, small_session, monkeypatch
):
    """PHYSICS: nearer light is brighter, by several percent of a depth of 1.5 mm."""
    monkeypatch.setattr(near_light, "NEAR_LIGHT_ROUNDS", 0)
    frozen = solved(rgb, small_calibration)
    (rounds,) = (step.reason for step in frozen.trace.steps if "quarter scale" in step.name)
    assert "rounds: 0" in rounds
    error = scored(frozen, small_calibration, small_session).height_percent
    best = scored(whole, small_calibration, small_session).height_percent
    assert abs(error) > abs(best) + 1.0
