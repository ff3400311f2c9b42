"""What is stated wrong is found by the fit of all presses, and named with the value that fits."""

from dataclasses import replace

import numpy as np
import pytest
from test_joint_refinement import (
    BALLS,
    MIRROR,
    NO_MAP,
    SLAB,
    Truth,
    found_press,
    pixels_of,
    shaded,
    truth,
)

from gelpolight_core.base.finding import QualityTable, Verdict
from gelpolight_core.base.root_causes import best_cause
from gelpolight_core.calibration.ball_pixels import BallPixels
from gelpolight_core.calibration.joint_refinement import StatedLengthFit, refine_jointly
from gelpolight_core.calibration.refinement_problem import RISE_SHARE
from gelpolight_core.calibration.refinement_stage import judge_stated_lengths
from gelpolight_core.geometry.membrane_shape import MembraneShape
from gelpolight_core.geometry.refraction import LayerStack
from gelpolight_core.light.light_terms import LIGHT_TERMS
from gelpolight_core.session.session import SensorData
from gelpolight_core.stages.balls.ball_geometry import BallPose
from gelpolight_core.stages.balls.draped_ball import draped_ball

BRIGHT = 0.75 * MIRROR[:, :2]
SENSOR = SensorData("A", 13.7, 14.0, 1.41, 0.0, 1.49, 26.0)
STACK = LayerStack((25.0, 14.0), (1.0, 1.41))
FIELD_MM = 19.0


def on_dome(flat: BallPixels, pose: BallPose, known: Truth, rise_mm: float) -> BallPixels:
    """Return what the rays of a press see of one in a dome, as those of a flat membrane."""
    dome = MembraneShape(diameter_mm=FIELD_MM, rise_mm=rise_mm)
    at = flat.on(dome).points_mm
    seen, normals, _ = draped_ball(at, flat.ray_slope, pose, decay_mm=known.decay_mm, surface=dome)
    at_rest = shaded(known, dome.points(at), dome.normals(at), flat.view)
    return replace(flat, ratio=shaded(known, seen, normals, flat.view) / at_rest)


@pytest.mark.function("See which stated length contradicts the ball presses, and the one that fits")
@pytest.mark.parametrize(
    ("key", "stated", "named"),
    [
        ("", 1.0, ""),
        ("radius", 1.1, "the ball diameters (0.9"),
        pytest.param("layers", 1.05, "mm of elastomer or", marks=pytest.mark.long),
        pytest.param("square", 1.04, "the squares of the board", marks=pytest.mark.long),
        ("led_height", 0.7, "the LED height (19."),
        ("response", 1.1, "an exponent of 1.1"),
        ("contrast", 0.9, "presses have 0.90 of their contrast"),
        pytest.param("membrane", 1.5, "a cap 1.", marks=pytest.mark.long),
    ],
)
def test_what_is_stated_wrong_is_named(key, stated, named):
    known = truth(gloss=0.3, roughness=0.45, decay_mm=0.6)
    balls, random, leds = BALLS[:4], np.random.default_rng(0), MIRROR.copy()
    presses = [found_press(pose, random) for pose in balls]
    pixels = [pixels_of(pose, known, 0.003, random) for pose in balls]
    if key == "radius":
        of_balls = [replace(p.pose, radius_mm=stated * p.pose.radius_mm) for p in presses]
        presses = [replace(p, pose=pose) for p, pose in zip(presses, of_balls, strict=True)]
        pixels = [replace(p, radius_mm=stated * p.radius_mm) for p in pixels]
    if key == "response":
        pixels = [replace(p, ratio=p.ratio ** (1.0 / stated)) for p in pixels]
    if key == "contrast":
        pixels = [replace(p, ratio=stated * p.ratio + 1.0 - stated) for p in pixels]
    if key in ("layers", "square"):
        pixels = [replace(p, points_mm=stated * p.points_mm) for p in pixels]
    if key == "membrane":
        rise_mm = (stated - 1.0) * RISE_SHARE * FIELD_MM
        pairs = zip(pixels, balls, strict=True)
        pixels = [on_dome(p, pose, known, rise_mm) for p, pose in pairs]
    if key == "square":
        leds[:, :2] += (stated - 1.0) * BRIGHT
    if key == "led_height":
        leds += (stated - 1.0) * (leds - np.pad(BRIGHT, ((0, 0), (0, 1))))
    joint = refine_jointly(presses, pixels, leds, SLAB, NO_MAP, bright_mm=BRIGHT)
    (figure,) = judge_stated_lengths(joint.stated, SENSOR, STACK, FIELD_MM)
    cause = best_cause({"joint": QualityTable((figure,))})
    if key:
        assert joint.stated[0].key == key
        assert named in cause.remedy
    # No term of the light takes up its error.
    assert not any(joint.evidence[term.key].used for term in LIGHT_TERMS)
    assert (figure.verdict is Verdict.PASS) == (not key)


def test_two_lengths_that_explain_the_presses_equally_well_are_both_named():
    found = (("layers", 0.98, 100.0), ("led_height", 1.1, 100.5), ("radius", 1.05, 110.0))
    stated = [StatedLengthFit(key, value, 0.005, left) for key, value, left in found]
    (figure,) = judge_stated_lengths(stated, SENSOR, STACK, FIELD_MM)
    assert "of elastomer or" in figure.remedy
    assert "the LED height (15.1 mm fits)" in figure.remedy
    assert "diameters" not in figure.remedy


def test_a_wrong_length_is_more_likely_than_a_camera_that_blends_its_frames():
    stated = [
        StatedLengthFit("contrast", 0.96, 0.004, 102.0, asked=True),
        StatedLengthFit("radius", 1.03, 0.004, 100.0),
    ]
    stated.sort(key=lambda one: one.unlikely)
    (figure,) = judge_stated_lengths(stated, SENSOR, STACK, FIELD_MM)
    assert figure.remedy.index("diameters") < figure.remedy.index("noise reduction")


@pytest.mark.parametrize("asked", [False, True])
@pytest.mark.parametrize("sds", [1.5, 2.5, 3.5])
def test_what_is_within_its_deviation_passes_however_large_it_is(sds, asked):
    stated = [StatedLengthFit("radius", 1.0 + 0.08 * sds, 0.08, 100.0, asked)]
    (figure,) = judge_stated_lengths(stated, SENSOR, STACK, FIELD_MM)
    is_shown = sds > (2.0 if asked else 3.0)
    assert figure.verdict is (Verdict.FAIL if is_shown else Verdict.PASS)
