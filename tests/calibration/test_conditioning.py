"""What ball presses cannot tell apart is named, with what it costs in height."""

import numpy as np
import pytest

from gelpolight_core.base.finding import Verdict
from gelpolight_core.calibration import refinement_parameters as parameters
from gelpolight_core.calibration.conditioning import (
    ParameterConditioning,
    judge_determined,
)

TERMS = parameters.terms_of_sensor(
    parameters.KnownOfSensor(np.zeros((3, 3))), parameters.OPTIONAL, flat=True
)
SHARED = [parameter for term in TERMS for parameter in term.parameters]
GLOSS, ROUGHNESS, DECAY = map(
    SHARED.index, (parameters.GLOSS, parameters.ROUGHNESS, parameters.DECAY)
)
PARAMETERS = np.array([2, GLOSS, ROUGHNESS, DECAY])


def jacobian(likeness: float) -> np.ndarray:
    """Return rows for four shared parameters and three of a ball; gloss acts like roughness."""
    slopes = np.random.default_rng(3).normal(size=(400, 7)) * [9.0, 5.0, 1.0, 0.2, 1.0, 1.0, 1.0]
    slopes[:, 2] = likeness * slopes[:, 1] / 5.0 + np.sqrt(1.0 - likeness**2) * slopes[:, 2]
    slopes[:, 3] += 0.3 * slopes[:, 5]  # the ball explains a part of what the decay does
    return slopes


def test_the_directions_are_those_of_the_scaled_jacobian_beside_the_balls():
    slopes = jacobian(0.9)
    found = ParameterConditioning.from_jacobian(slopes.T @ slopes, PARAMETERS)
    shared, balls = slopes[:, :4], slopes[:, 4:]
    beside = shared - balls @ np.linalg.lstsq(balls, shared, rcond=None)[0]
    expected = np.linalg.svd(beside / np.linalg.norm(beside, axis=0), compute_uv=False)
    np.testing.assert_allclose(found.singular, expected[::-1], rtol=1e-9)
    assert found.condition == pytest.approx(expected[0] / expected[-1])
    assert set(found.weakest) == {GLOSS, ROUGHNESS}
    covariance = np.linalg.inv(slopes.T @ slopes)
    size = covariance[1, 2] / np.sqrt(covariance[1, 1] * covariance[2, 2])
    assert found.correlation == (pytest.approx(size), GLOSS, ROUGHNESS)


@pytest.mark.function(
    "See which parameters the ball presses hardly tell apart, and what that costs in height"
)
@pytest.mark.parametrize(("sd", "verdict"), [(0.01, Verdict.PASS), (0.1, Verdict.WARN)])
def test_a_direction_warns_only_where_it_makes_heights_wrong(sd, verdict):
    slopes = jacobian(0.999)
    found = ParameterConditioning.from_jacobian(slopes.T @ slopes, PARAMETERS)
    covariance, gradient = np.zeros((len(SHARED), len(SHARED))), np.zeros(len(SHARED))
    covariance[DECAY, DECAY], gradient[DECAY] = sd**2, 0.3
    condition, correlation, direction = judge_determined(found, SHARED, covariance, gradient)
    # However much alike gloss and roughness are, that alone does not warn.
    assert condition.value > 20.0 and correlation.value < -0.99
    assert condition.verdict is correlation.verdict is Verdict.PASS
    assert direction.value == pytest.approx(100.0 * 0.3 * sd)
    assert "(decay length)" in direction.text
    assert direction.verdict is verdict


def test_what_no_press_shows_is_named_and_does_not_break_the_figures():
    slopes = jacobian(0.0)
    slopes[:, 0] = 0.0
    found = ParameterConditioning.from_jacobian(slopes.T @ slopes, PARAMETERS)
    assert found.weakest == [2] and np.isfinite(found.condition) and found.condition > 1e6
