"""The uncertainty of lengths of a calibration."""

from dataclasses import replace

import numpy as np
import pytest
import scene

from gelpolight_core.calibration import depth_scale
from gelpolight_core.calibration.conditioning import jackknife_covariance
from gelpolight_core.calibration.depth_scale import height_gradient, lateral_scale_sd
from gelpolight_core.calibration.refinement_parameters import KnownOfSensor, terms_of_sensor
from gelpolight_core.geometry.refraction import LayerStack, build_stack
from gelpolight_core.light.membrane_brdf import MembraneBrdf


def test_wider_parameters_leave_depths_as_much_less_sure(monkeypatch):
    monkeypatch.setattr(depth_scale, "NODES", 64)  # a deviation needs fewer than a depth
    calibration = scene.full_calibration(MembraneBrdf(1.0, 0.2, 0.5, 0.3))
    full = calibration.data.full
    assert full is not None
    terms = terms_of_sensor(
        KnownOfSensor(full.led_positions_mm), ("leds", "gloss", "interreflection"), flat=True
    )
    values = {"gloss": 0.2, "interreflection": 0.3}
    shared = [
        replace(p, start=values.get(p.key, p.start)) for term in terms for p in term.parameters
    ]
    x = np.array([parameter.start for parameter in shared])
    deviations = {"gloss": 0.01, "roughness": 0.01, "interreflection": 0.02, "decay_mm": 1.0}
    sd = np.array([deviations.get(parameter.key, 0.02) for parameter in shared])

    def depth_sd(sd: np.ndarray) -> float:
        gradient = height_gradient(full, calibration.table, shared, x, np.diag(sd**2))
        return float(np.linalg.norm(gradient * sd))

    once, twice = depth_sd(sd), depth_sd(2.0 * sd)
    assert twice == pytest.approx(2.0 * once, rel=0.05)
    assert depth_sd(0.0 * sd) == 0.0
    # LED errors of 0.1 mm cost 0.4 % of depth, so 0.02 mm cost about 0.1 %; gloss of 0.01 costs up
    # to 1 %. A parameter that a depth does not use (decay) costs nothing.
    assert 5e-4 < once < 2e-2
    assert depth_sd(np.array([float(p.key == "decay_mm") for p in shared])) < 1e-6


def test_walls_give_back_more_of_an_error_the_more_light_they_reflect(monkeypatch):
    monkeypatch.setattr(depth_scale, "NODES", 96)

    def feedback(reflectance: float) -> float:
        data = scene.full_calibration(MembraneBrdf(1.0, 0.2, 0.5, reflectance)).data
        assert data.full is not None
        return depth_scale.light_feedback(data.full, data.table)

    found = [feedback(reflectance) for reflectance in (0.0, 0.3, 0.8)]
    assert found[0] == 0.0
    assert 0.02 < found[1] < found[2] < 0.9


def stack(glass: bool) -> LayerStack:
    return build_stack(
        39.0,
        elastomer_thickness_mm=14.0,
        elastomer_index=1.41 if glass else 1.0,
        window_thickness_mm=0.0,
        window_index=1.0,
    )


def test_focal_length_and_distance_err_together_and_leave_the_scale():
    focal_sd = 1e-3
    alone = 39.0 * focal_sd
    assert lateral_scale_sd(stack(False), alone, focal_sd) < 1e-9
    # Refraction lifts 14 mm by 14 (1 - 1/1.41) = 4.07 mm, which does not scale with the focal
    # length.
    assert lateral_scale_sd(stack(True), alone, focal_sd) == pytest.approx(
        focal_sd * 4.07 / (39.0 - 4.07), rel=1e-3
    )
    own = lateral_scale_sd(stack(False), float(np.hypot(alone, 0.039)), focal_sd)
    assert own == pytest.approx(1e-3, rel=1e-3)


def test_leaving_presses_out_shows_errors_that_a_press_has_as_a_whole():
    """A line fit to groups of points with common errors: scatter of repeats and stated sd."""
    random = np.random.default_rng(3)
    groups, points = 12, 50
    found, stated, naive = [], [], []
    for _ in range(150):
        places = [
            random.uniform(0.0, 1.0) + 0.05 * random.normal(size=points) for _ in range(groups)
        ]
        rows = [np.stack([np.ones(points), p], axis=1) for p in places]
        errors = [0.1 * random.normal() + 0.02 * random.normal(size=points) for _ in range(groups)]
        line = np.linalg.lstsq(np.concatenate(rows), np.concatenate(errors), rcond=None)[0]
        left = [r @ line - e for r, e in zip(rows, errors, strict=True)]
        covariance = jackknife_covariance(rows, left, np.zeros((1, 2)), common=2)
        found.append(line[1])
        stated.append(covariance[1, 1])
        every = np.concatenate(rows)
        naive.append(np.linalg.inv(every.T @ every)[1, 1] * np.var(np.concatenate(left)))
    seen = np.std(found)
    assert np.sqrt(np.mean(stated)) == pytest.approx(seen, rel=0.25)
    assert np.sqrt(np.mean(naive)) < 0.3 * seen


def test_a_lone_press_is_known_no_better_than_its_own_pixels_say():
    random = np.random.default_rng(4)
    rows = np.stack([np.ones(40), random.uniform(size=40), np.zeros(40)], axis=1)
    errors = random.normal(size=40)
    left = errors - rows @ np.linalg.lstsq(rows, errors, rcond=None)[0]
    weightless = np.zeros((5, 3))
    inverse = np.linalg.inv(rows[:, :2].T @ rows[:, :2])
    prior = np.zeros((1, 3))
    # Residuals larger than the weights predict widen it; smaller ones do not narrow it.
    for size, excess in ((3.0, 9.0 * float(left @ left) / 38), (0.1, 1.0)):
        residuals = size * np.concatenate([left, np.zeros(5)])
        covariance = jackknife_covariance(
            [np.concatenate([rows, weightless])], [residuals], prior, common=2
        )
        np.testing.assert_allclose(covariance, excess * inverse, rtol=1e-9)


@pytest.mark.function("Know how certain heights are")
def test_a_calibration_says_how_sure_its_heights_are(small_calibration):
    full = small_calibration.data.full
    figure = small_calibration.quality["joint"]["depth_sd_percent"]
    assert figure.value == pytest.approx(100.0 * full.scale_sd.depth)
    # Of a quarter of the image's size and five balls; below 0.1 % is no known sensor of this kind.
    assert 0.1 < figure.value < 5.0
    assert full.scale_sd.lateral < 1e-3
