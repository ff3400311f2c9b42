"""Derivatives of the residuals of the joint refinement."""

from dataclasses import replace

import numpy as np
import pytest
from test_board_light import board

from gelpolight_core.base.finding import QualityTable
from gelpolight_core.calibration.ball_pixels import BallPixels, CoarseRayGrid
from gelpolight_core.calibration.refinement_parameters import (
    OPTIONAL,
    KnownOfSensor,
    ball_parameters,
    terms_of_sensor,
)
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


LIGHTS = np.array([[0.5, 11.8, -13.7], [-10.4, -5.6, -13.7], [10.1, -6.3, -13.7]])
BALLS = np.array([[-2.05, 1.1, 0.9], [3.1, -1.45, 1.2]])
LEFT_OUT = [(), ("curves",), ("lobe", "absorption", "stretch"), tuple(OPTIONAL)]
AWAY = {"gloss": 0.2, "roughness": 0.4, "lobe_exponent": 1.6, "stretch_loss": 0.12}
"""From the neutral value, where some derivatives are 0."""


def problem(*, without: tuple[str, ...] = ()) -> JointProblem:
    """Return two presses of random pixels, with all terms but some."""
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
    found = [
        BallPress("ball", BallPose((x, y), 4.0, depth), 1.8, 0.02, 0.02, None, QualityTable(()))
        for x, y, depth in BALLS.tolist()
    ]
    used = [key for key in OPTIONAL if key not in without]
    terms = terms_of_sensor(KnownOfSensor(LIGHTS + 0.01), used, flat=False)
    shared = [
        replace(p, free=True, start=AWAY.get(p.key, p.start + 0.2 * p.typical_change))
        for term in terms
        for p in term.parameters
    ]
    return JointProblem(presses, (*shared, *ball_parameters(found, presses)), board(LIGHTS))


@pytest.mark.parametrize("without", LEFT_OUT)
def test_slopes_are_those_of_moving_every_parameter_alone(without):
    found = problem(without=without)
    x = found.start
    alone = np.stack([(found.all(x + d) - found.all(x)) / STEP for d in STEP * np.eye(x.size)], 1)
    slopes = found.jacobian(x)
    size = np.abs(alone).max(axis=0)
    assert (np.abs(slopes - alone).max(axis=0) <= 1e-9 * size.max()).all()
    # Every parameter is seen by something.
    assert (size > 0.0).all()


def test_a_term_at_its_neutral_value_is_as_good_as_absent():
    """What is left out by evidence costs nothing, and changes nothing."""
    terms = ("gloss", "curves", "lobe", "absorption", "stretch", "interreflection")
    whole, bare = problem(), problem(without=terms)
    left = {p.full_key for p in bare.parameters}
    neutral = [
        p.start if p.full_key in left else p.neutral for p in whole.parameters if p.press is None
    ]
    x = np.array([*neutral, *bare.start[-BALLS.size :]])
    for one, other in zip(whole.residuals(x), bare.residuals(bare.start), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("without", LEFT_OUT)
def test_a_value_is_found_by_its_parameter(without):
    found = problem(without=without)
    x = np.linspace(0.1, 0.2, len(found.parameters))
    place = {(p.key, p.channel, p.press): v for p, v in zip(found.parameters, x, strict=True)}
    values = found.values(x)
    assert values.leds_mm[1, 2] == place["led_height_mm", 1, None]
    assert values.decay_mm == place["decay_mm", None, None]
    assert values.balls_mm[1, 2] == place["ball_depth_mm", None, 1]
    shifted = values.on(CAP)
    assert shifted.rise_mm == CAP.rise_mm + place["rise_mm", None, None]
    assert shifted.axis_mm[1] == CAP.axis_mm[1] + place["axis_y_mm", None, None]
    gloss, roughness, reflectance = (
        place.get((key, None, None), neutral)
        for key, neutral in (("gloss", 0.0), ("roughness", 0.5), ("interreflection", 0.0))
    )
    assert values.lobes == (1.0, gloss, roughness)
    assert values.interreflection == values.membrane.interreflection == reflectance
    if "curves" in without:
        assert values.curves.shape == (3, 0)
        assert values.membrane.diffuse == ()
    else:
        assert values.curves[2, 1] == place["curve_0.4", 2, None]
    # The reconstruction gets exactly the terms in use.
    expected = {} if "stretch" in without else {"stretch_loss": place["stretch_loss", None, None]}
    assert {k: v for k, v in values.membrane.terms.items() if k == "stretch_loss"} == expected
    loss = values.membrane.light.loss_per_mm
    green = place.get(("absorption_per_mm", 1, None), 0.0)
    assert loss[1] == green
    assert bool(values.membrane.terms) == ("lobe" not in without)


def test_what_is_known_beforehand_counts_by_its_standard_deviation():
    """Large deviations of a ball press count less; those from a prior do not."""
    found = problem()
    priors = [p for p in found.parameters if p.prior is not None]
    slopes = found.jacobian(found.start)[-len(priors) :]
    for one in priors:
        column = slopes[:, found.parameters.index(one)]
        assert column[column != 0.0] == pytest.approx([1.0 / one.prior.sd], rel=1e-6)
    pixels = sum(press.ratio.size for press in found.presses)
    assert found.robust[:pixels].all()
    assert not found.robust[pixels:].any()
    assert found.robust.size == pixels + found.board.size + len(priors)
