"""Joint refinement on ball pixels with known light, membrane and balls.

The pixels are shaded here with other formulae than in the program: rays are marched onto the
simulator's drape, and the lobe of the membrane is the published one in terms of cosines.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from gelpolight_core.base.finding import QualityTable, Verdict
from gelpolight_core.calibration.ball_pixels import BallPixels, CoarseRayGrid, view_directions
from gelpolight_core.calibration.joint_refinement import JointRefinement, refine_jointly
from gelpolight_core.calibration.refinement_parameters import OPTIONAL
from gelpolight_core.calibration.refinement_stage import judge_presses
from gelpolight_core.light.facet_interreflection import Slab
from gelpolight_core.light.membrane_brdf import MembraneBrdf
from gelpolight_core.simulation.drape import contact_radius, free_profile
from gelpolight_core.simulation.indenters import BallIndenter
from gelpolight_core.stages.balls.ball_geometry import BallPose
from gelpolight_core.stages.balls.ball_press import BallPress

Array = NDArray[np.float64]
MIRROR = np.array([[0.5, 11.8, -13.7], [-10.4, -5.6, -13.7], [10.1, -6.3, -13.7]])
# The housing's nominal height is not each LED's own; across, 0.3 px of a spot are 0.02 mm.
MOVED_MM = np.array([[0.015, -0.01, 0.12], [-0.02, 0.01, -0.17], [0.01, 0.02, 0.2]])
BALLS = (
    BallPose((-4.1, -1.6), 3.0, 1.05),
    BallPose((0.2, 1.2), 4.0, 1.15),
    BallPose((-2.1, -6.2), 3.0, 0.85),
    BallPose((2.3, -3.4), 4.0, 1.35),
    BallPose((-1.0, 5.6), 3.0, 1.1),
    BallPose((5.8, 1.9), 4.0, 0.9),
    BallPose((-6.4, 3.1), 3.0, 0.95),
    BallPose((4.2, 5.3), 4.0, 1.2),
)
PIXELS = 120  # on the cap, and as many on the drape
# This many neighbouring pixels have a common error; the square of the program's own factor.
TOGETHER = 16
# An index of 1 has no lower face that returns light.
SLAB = Slab(14.0, 1.0, 1.0)
NO_MAP = np.zeros((1, 1, 3), np.float32)
SIDE_MM, NODES = 0.2, 96
AXIS = SIDE_MM * (np.arange(NODES) - 0.5 * (NODES - 1))
FIELD = np.stack(np.meshgrid(AXIS, AXIS), axis=-1).reshape(-1, 2)
VIEW = CoarseRayGrid(
    FIELD,
    -FIELD / 38.0,
    view_directions(-FIELD.reshape(NODES, NODES, 2) / 38.0),
    np.ones((NODES, NODES), np.float32),
    SIDE_MM,
    1,
)


@dataclass(frozen=True)
class Truth:
    """The truth behind the pixels."""

    leds: Array
    gloss: float = 0.0
    roughness: float = 0.5
    interreflection: float = 0.0
    decay_mm: float = 0.7
    grazing: float = 0.0  # so much brighter than Lambert's law under grazing light
    lobe: float = 1.0  # exponent of the LEDs' light around their axes
    loss_per_mm: tuple[float, float, float] = (0.0, 0.0, 0.0)
    stretch: float = 0.0  # loss of reflectance at twice the area


def truth(**changes: Any) -> Truth:
    return replace(Truth(MIRROR + MOVED_MM), **changes)


def drape(place: Array, pose: BallPose, decay_mm: float) -> Array:
    """Return the simulator's depth at true positions (..., 2)."""
    ball = BallIndenter(pose.radius_mm, pose.depth_mm)
    b = contact_radius(ball.profile, ball.reach_mm, decay_mm)
    r = np.hypot(place[..., 0] - pose.centre_mm[0], place[..., 1] - pose.centre_mm[1])
    outside = free_profile(np.maximum(r, b), b, ball.profile(b)[0], decay_mm)
    return np.where(r <= b, ball.obstacle(np.minimum(r, b), 0.0 * r), outside)


def shaded(truth: Truth, place: Array, normals: Array, view: Array) -> Array:
    """Return the brightness of points (N, 3) under three LEDs that face +z."""
    columns = []
    to_camera_mm = -(SLAB.thickness_mm + place[:, 2]) / view[:, 2]
    for led, loss in zip(truth.leds, truth.loss_per_mm, strict=True):
        light = led - place
        r2 = (light**2).sum(-1, keepdims=True)
        light = light / np.sqrt(r2)
        lit = np.clip((light * normals).sum(-1), 1e-3, None)
        seen = np.clip((view * normals).sum(-1), 1e-2, None)
        half = light + view
        tilt = (half * normals).sum(-1) / np.linalg.norm(half, axis=-1)
        a2 = truth.roughness**2
        spread = a2 / np.pi / (1.0 - tilt**2 * (1.0 - a2)) ** 2
        masks = 1.0
        for cosine in (lit, seen):
            masks = masks * 2.0 / (1.0 + np.sqrt(1.0 + a2 * (1.0 / cosine**2 - 1.0)))
        lobe = truth.gloss * spread * masks / (4.0 * seen)
        both = (1.0 - truth.gloss) * lit / np.pi * (1.0 + truth.grazing * (1.0 - lit)) + lobe
        gel = np.exp(-loss * (np.sqrt(r2[:, 0]) + to_camera_mm))
        columns.append(both * gel * (-light[:, 2]) ** truth.lobe / r2[:, 0])
    return np.stack(columns, axis=-1) * (1.0 + truth.stretch + truth.stretch / normals[:, 2:])


def pixels_of(
    pose: BallPose, truth: Truth, noise: float, random: np.random.Generator
) -> BallPixels:
    """Return the pixels of one press, neighbours in runs of `TOGETHER`."""
    ball = BallIndenter(pose.radius_mm, pose.depth_mm)
    b = contact_radius(ball.profile, ball.reach_mm, truth.decay_mm)
    r = np.concatenate(
        [b * 0.9 * np.sqrt(random.uniform(0, 1, PIXELS)), b + random.uniform(0.12, 1.6, PIXELS)]
    )
    angle = np.concatenate([np.sort(random.uniform(0, 2 * np.pi, PIXELS)) for _ in range(2)])
    place = np.asarray(pose.centre_mm) + np.stack([r * np.cos(angle), r * np.sin(angle)], -1)
    depth = drape(place, pose, truth.decay_mm)
    # The ray through a true point is tilted by its ray slope: P0 = P - depth w(P0), w = -P0 / 38.
    points = place / (1.0 - depth[:, None] / 38.0)
    ray_slope = -points / 38.0
    step = 1e-5
    slope = np.stack(
        [
            (drape(place + m, pose, truth.decay_mm) - drape(place - m, pose, truth.decay_mm))
            for m in (np.array([step, 0.0]), np.array([0.0, step]))
        ],
        axis=-1,
    ) / (2.0 * step)
    normals = np.concatenate([-slope, -np.ones((len(r), 1))], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    view = np.concatenate([ray_slope, -np.ones((len(r), 1))], axis=1)
    view /= np.linalg.norm(view, axis=1, keepdims=True)
    flat = np.concatenate([points, np.zeros((len(r), 1))], axis=1)
    up = np.broadcast_to([0.0, 0.0, -1.0], flat.shape)
    seen = np.concatenate([place, -depth[:, None]], axis=1)
    ratio = shaded(truth, seen, normals, view) / shaded(truth, flat, up, view)
    field = np.ones((NODES, NODES, 3), np.float32)
    if truth.interreflection > 0.0:
        reflected, field = reflected_light(truth, pose, seen, normals)
        ratio += truth.interreflection * reflected / shaded(truth, flat, up, view)
    runs = random.normal(size=(-(-len(r) // TOGETHER), 3)).repeat(TOGETHER, axis=0)
    ratio += noise * runs[: len(r)]
    weight = np.full_like(ratio, 1.0 / max(noise, 0.01))
    nothing = np.zeros_like(ratio)
    return BallPixels(
        points, ray_slope, view, ratio, weight, pose.radius_mm, VIEW, field, nothing, nothing
    )


def reflected_light(
    truth: Truth, pose: BallPose, points: Array, normals: Array
) -> tuple[Array, NDArray[np.float32]]:
    """Return what points receive of a matt membrane, facet by facet; press over background."""
    depth = np.zeros(len(FIELD))
    for _ in range(30):
        depth = drape(FIELD - depth[:, None] * FIELD / 38.0, pose, truth.decay_mm)
    place = FIELD * (1.0 - depth[:, None] / 38.0)
    step = 1e-4
    slope = [
        (drape(place + m, pose, truth.decay_mm) - drape(place - m, pose, truth.decay_mm))
        / (2.0 * step)
        for m in (np.array([step, 0.0]), np.array([0.0, step]))
    ]
    facets = np.stack([-slope[0], -slope[1], -np.ones_like(depth)], axis=-1)
    # Seen along rays that meet at the camera, facets are narrower where they are nearer.
    area = SIDE_MM**2 * np.linalg.norm(facets, axis=1) * (1.0 - depth / 38.0) ** 2
    facets /= np.linalg.norm(facets, axis=1, keepdims=True)
    seen = np.concatenate([place, -depth[:, None]], axis=1)
    view = view_directions(-FIELD / 38.0)
    bright = shaded(truth, seen, facets, view)
    flat = np.concatenate([FIELD, np.zeros((len(FIELD), 1))], axis=1)
    up = np.broadcast_to([0.0, 0.0, -1.0], flat.shape)
    field = bright / shaded(truth, flat, up, view)
    way = seen[None] - points[:, None]
    r2 = np.maximum((way**2).sum(axis=-1), SIDE_MM**2 / 4.0)
    arrives = np.maximum(np.einsum("nmc,nc->nm", way, normals), 0.0)
    leaves = np.maximum(-np.einsum("nmc,mc->nm", way, facets), 0.0)
    share = arrives * leaves * area / (np.pi * r2 * r2)
    return share @ bright, field.reshape(NODES, NODES, 3).astype(np.float32)


def found_press(pose: BallPose, random: np.random.Generator) -> BallPress:
    """Return the ball as found by an earlier stage: slightly shifted, its depth 5 % wrong."""
    x, y = np.asarray(pose.centre_mm) + random.normal(scale=0.02, size=2)
    depth = pose.depth_mm * (1.0 + 0.05 * random.normal())
    start = BallPose((float(x), float(y)), pose.radius_mm, float(depth))
    return BallPress("ball", start, 1.8, 0.02, 0.02, None, QualityTable(()))


def refined(truth: Truth, *, noise: float = 0.01, seed: int = 0, count: int = 8) -> JointRefinement:
    random = np.random.default_rng(seed)
    presses = [found_press(pose, random) for pose in BALLS[:count]]
    pixels = [pixels_of(pose, truth, noise, random) for pose in BALLS[:count]]
    return refine_jointly(presses, pixels, MIRROR, SLAB, NO_MAP)


def needed(result: JointRefinement) -> set[str]:
    return {key for key, one in result.evidence.items() if one.used}


@pytest.mark.function("Refine lights, gloss and radii jointly over all presses")
def test_leds_that_are_not_at_the_housings_height_are_found():
    """With gloss and decay length of the membrane, and the places of the balls."""
    known = truth(gloss=0.3, roughness=0.45, decay_mm=0.6)
    # Little noise: with the usual 1 %, held-out presses hardly distinguish LEDs that are 0.2 mm off
    # from true ones, and the choice is random.
    result = refined(known, noise=0.003)
    assert result.full.kept == "refined"
    left = np.linalg.norm(result.full.led_positions_mm - known.leds, axis=1)
    before = np.linalg.norm(MIRROR - known.leds, axis=1)
    # 0.1 mm of LED position costs 0.4 % of depth.
    assert (left < 0.1).all()
    assert left.mean() < 0.5 * before.mean()
    assert result.full.membrane.gloss == pytest.approx(known.gloss, abs=0.06)
    assert result.full.membrane.roughness == pytest.approx(known.roughness, abs=0.08)
    assert result.full.decay_mm == pytest.approx(known.decay_mm, abs=0.01)
    for ball, pose in zip(result.balls, BALLS, strict=True):
        assert np.hypot(*np.subtract(ball.centre_mm, pose.centre_mm)) < 0.03
        assert ball.depth_mm == pytest.approx(pose.depth_mm, abs=0.03)
        assert ball.radius_mm == pose.radius_mm
    # No single curve of the light's cosine explains brightness that depends on the view. What the
    # sensor does not need is exactly absent.
    assert needed(result) == {"leds", "gloss"}
    assert not result.full.membrane.diffuse
    assert not result.full.membrane.terms
    assert result.full.membrane.interreflection == 0.0
    gloss = result.evidence["gloss"]
    assert gloss.gain > 3.0 * gloss.scatter > 0.0
    # Of the light of the presses, this membrane's gloss is far above the noise.
    assert result.full.worth["gloss"] > 0.01 > 0.003 > result.full.worth["stretch"]
    assert result.full.misfit == pytest.approx(0.003, rel=0.2)
    # Pixel errors are correlated, as from lens and ball; weights allow for 1 % of noise at least.
    found, of = result.full, result.full.membrane_sd
    stated = np.array([*found.led_sd_mm.ravel(), of["decay_mm"], of["gloss"]])
    off = np.array([found.decay_mm - known.decay_mm, found.membrane.gloss - known.gloss])
    share = np.append(found.led_positions_mm - known.leds, off) / stated
    assert 0.3 / 2.5 < np.sqrt(np.mean(share**2)) < 2.5 * 0.3


def test_a_matt_membrane_gets_no_gloss_and_its_interreflection():
    known = truth(interreflection=0.3, decay_mm=0.8)
    result = refined(known, seed=1, count=5)
    assert "interreflection" in needed(result)
    assert result.full.membrane.gloss == 0.0
    assert result.full.membrane.interreflection == pytest.approx(0.3, abs=0.1)
    assert result.full.decay_mm == pytest.approx(0.8, abs=0.02)


def test_a_matt_membrane_that_is_not_lamberts_is_a_curve():
    known = truth(grazing=0.35)
    result = refined(known, noise=0.003, seed=2)
    assert needed(result) == {"curves"}
    assert result.full.membrane.gloss == 0.0
    # The curves explain what LEDs that are 0.2 mm higher would change, too.
    np.testing.assert_array_equal(result.full.led_positions_mm, MIRROR)
    # Over the cosines covered by the balls, except for its height, which is not observable.
    cosine = np.linspace(0.4, 0.95, 30)
    expected = cosine * (1.0 + known.grazing * (1.0 - cosine))
    share = result.full.membrane.diffuse_share(np.repeat(cosine[:, None], 3, axis=1))
    ratio = share / expected[:, None]
    assert (np.ptp(ratio, axis=0) / ratio.mean(axis=0) < 0.04).all()


def test_leds_are_refined_only_where_held_out_presses_ask_for_it():
    """Every press was made with its own LEDs: no common solution exists."""
    random, known = np.random.default_rng(0), truth()
    presses = [found_press(pose, random) for pose in BALLS[:4]]
    pixels = []
    for pose in BALLS[:4]:
        own = replace(known, leds=MIRROR + random.normal(scale=0.6, size=(3, 3)))
        pixels.append(pixels_of(pose, own, 0.03, random))
    result = refine_jointly(presses, pixels, MIRROR, SLAB, NO_MAP)
    leds = result.evidence["leds"]
    assert leds.gain < 3.0 * leds.scatter
    assert result.full.kept == "mirror"
    np.testing.assert_array_equal(result.full.led_positions_mm, MIRROR)
    assert not result.full.led_sd_mm.any()


@pytest.mark.parametrize(
    ("key", "changes", "expected", "within"),
    [
        ("lobe", {"lobe": 1.6}, {"lobe_exponent": 1.6}, 0.2),
        (
            "absorption",
            {"loss_per_mm": (0.01, 0.015, 0.02)},
            {"absorption_per_mm_red": 0.01, "absorption_per_mm_blue": 0.02},
            0.003,
        ),
        ("stretch", {"stretch": 0.12}, {"stretch_loss": 0.12}, 0.02),
    ],
)
def test_a_term_of_a_real_sensor_is_found_and_no_other(key, changes, expected, within):
    result = refined(truth(leds=MIRROR, **changes), noise=0.003, seed=4)
    assert needed(result) == {key}
    membrane = result.full.membrane
    for name, value in expected.items():
        assert membrane.terms[name] == pytest.approx(value, abs=within)
        assert abs(membrane.terms[name] - value) < 3.0 * result.full.membrane_sd[name]
    assert set(membrane.terms) == {k for k in result.full.membrane_sd if k in membrane.terms}
    assert (membrane.gloss, membrane.interreflection, membrane.diffuse) == (0.0, 0.0, ())


def test_an_ideal_sensor_needs_no_term():
    result = refined(truth(leds=MIRROR), noise=0.003, seed=5)
    assert needed(result) == set()
    assert result.full.membrane == MembraneBrdf()
    assert result.full.membrane.terms == {}
    assert set(result.full.membrane_sd) == {"decay_mm"}
    # Nothing was taken for granted: every term was tried.
    assert set(result.full.worth) == set(OPTIONAL)
    assert max(result.full.worth.values()) < 0.003  # of noise


def test_one_press_that_is_not_a_ball_does_not_decide():
    random = np.random.default_rng(9)
    known = truth(decay_mm=0.6)
    presses = [found_press(pose, random) for pose in BALLS[:6]]
    pixels = [pixels_of(pose, known, 0.01, random) for pose in BALLS[:6]]
    dirt = random.uniform(0.3, 1.5, pixels[2].ratio[:60].shape)
    pixels[2].ratio[:60] = dirt
    result = refine_jointly(presses, pixels, MIRROR, SLAB, NO_MAP)
    assert result.full.decay_mm == pytest.approx(0.6, abs=0.02)
    assert result.full.membrane.gloss < 0.1
    assert result.ball_misfits.argmax() == 2
    for index in (0, 1, 3, 4, 5):
        assert np.hypot(*np.subtract(result.balls[index].centre_mm, BALLS[index].centre_mm)) < 0.03


def test_a_press_with_a_wrong_radius_stands_out_under_a_glossy_membrane():
    known, odd = truth(gloss=0.5, roughness=0.35, decay_mm=0.6), 3
    random = np.random.default_rng(0)
    presses = [found_press(pose, random) for pose in BALLS[:6]]
    pixels = [pixels_of(pose, known, 0.01, random) for pose in BALLS[:6]]
    wrong = 0.75 * presses[odd].pose.radius_mm
    presses[odd] = replace(presses[odd], pose=replace(presses[odd].pose, radius_mm=wrong))
    pixels[odd] = replace(pixels[odd], radius_mm=wrong)
    named = [replace(press, name=f"ball_{k}.png") for k, press in enumerate(presses)]
    bright_mm = 0.75 * MIRROR[:, :2]
    result = refine_jointly(named, pixels, MIRROR, SLAB, NO_MAP, bright_mm=bright_mm)
    figure = judge_presses(result)[0]
    assert figure.verdict is not Verdict.PASS
    assert named[odd].name in figure.remedy
    # No length that all presses share explains it better.
    assert named[odd].name in result.stated[0].key
