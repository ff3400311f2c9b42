"""Derivatives of the residuals of the joint refinement."""

from dataclasses import replace

import numpy as np
import pytest

from gelpolight_core.base.finding import QualityTable
from gelpolight_core.calibration.ball_pixels import BallPixels, CoarseRayGrid
from gelpolight_core.calibration.refinement_parameters import CURVES, FitChoice, fit_parameters
from gelpolight_core.calibration.refinement_problem import JointProblem
from gelpolight_core.geometry.membrane_shape import MembraneShape
from gelpolight_core.stages.balls.ball_geometry import BallPose
from gelpolight_core.stages.balls.ball_press import BallPress

STEP = 1e-4
CAP = MembraneShape("spherical_cap", 1.5, 20.0, (0.3, -0.2))
# Interreflected light is given: none is gathered.
NO_VIEW = CoarseRayGrid(
    np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 0, 3)), np.zeros((0, 0), np.float32), 1.0, 1
)


def problem(*, curves: bool) -> tuple[JointProblem, np.ndarray]:
    """Return two presses of random pixels, and parameters."""
    random = np.random.default_rng(5)
    presses = []
    for centre in ((-2.0, 1.0), (3.0, -1.5)):
        points = random.uniform(-2.5, 2.5, (40, 2)) + centre
        view = np.concatenate([random.uniform(-0.2, 0.2, (40, 2)), np.full((40, 1), -1.0)], axis=1)
        presses.append(
            BallPixels(
                points,
                random.uniform(-0.2, 0.2, (40, 2)),
                view / np.linalg.norm(view, axis=1, keepdims=True),
                random.uniform(0.5, 1.5, (40, 3)),
                random.uniform(0.9, 1.1, (40, 3)),
                4.0,
                NO_VIEW,
                np.zeros((0, 0, 3), np.float32),
                random.uniform(0.2, 1.0, (40, 3)),
                random.uniform(0.0, 0.1, (40, 3)),
                CAP,
            )
        )
    lights = [[0.5, 11.8, -13.7], [-10.4, -5.6, -13.7], [10.1, -6.3, -13.7]]
    membrane = [1.05, 0.2, 0.4, 0.15, 0.7, 0.02, 0.01, -0.03]
    balls = [-2.05, 1.1, 0.9, 3.1, -1.45, 1.2]
    x = np.concatenate([np.ravel(lights), membrane, balls, np.full(len(CURVES) * curves, 0.03)])
    found = [
        BallPress("ball", BallPose((x, y), 4.0, depth), 1.8, 0.02, 0.02, None, QualityTable(()))
        for x, y, depth in np.reshape(balls, (2, 3)).tolist()
    ]
    choice = FitChoice(around=True, refine=True, curves=curves, reflectance=(0.5, 0.1))
    parameters = fit_parameters(found, presses, np.array(lights) + 0.01, choice)
    return JointProblem(presses, tuple(replace(p, free=True) for p in parameters)), x


@pytest.mark.parametrize("curves", [False, True])
def test_slopes_are_those_of_moving_every_parameter_alone(curves):
    found, x = problem(curves=curves)
    alone = np.stack([(found.all(x + d) - found.all(x)) / STEP for d in STEP * np.eye(x.size)], 1)
    slopes = found.jacobian(x)
    size = np.abs(alone).max(axis=0)
    assert (np.abs(slopes - alone).max(axis=0) <= 1e-9 * size.max()).all()


@pytest.mark.parametrize("curves", [False, True])
def test_a_value_is_found_by_its_parameter(curves):
    found, _ = problem(curves=curves)
    x = np.arange(len(found.parameters), dtype=float)
    place = {(p.key, p.channel, p.press): i for i, p in enumerate(found.parameters)}
    values = found.values(x)
    assert values.leds_mm[1, 2] == place["led_height_mm", 1, None]
    assert values.lobes == tuple(
        place[key, None, None] for key in ("exponent", "gloss", "roughness")
    )
    assert values.interreflection == place["interreflection", None, None]
    assert values.decay_mm == place["decay_mm", None, None]
    assert values.shape_mm[1] == place["axis_x_mm", None, None]
    assert values.balls_mm[1, 2] == place["ball_depth_mm", None, 1]
    if curves:
        assert values.curves[2, 1] == place["curve_0.4", 2, None]
    else:
        assert values.curves.shape == (3, 0)
