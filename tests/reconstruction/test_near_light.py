"""Normals at a known depth: near light, gloss, interreflection, and channels that are missing."""

from dataclasses import replace

import numpy as np
import pytest
from compiled import RaySlopes, ShadedField, field_of, solve
from numpy.typing import NDArray

from gelpolight_core.light.membrane_brdf import CURVE_NODES, MembraneBrdf
from gelpolight_core.reconstruction.height_map import Flag
from gelpolight_core.reconstruction.near_light.depth_uncertainty import slope_noise
from gelpolight_core.reconstruction.near_light.kernel_structures import RegionSlopes

Array = NDArray[np.float64]
Map = NDArray[np.float32]
PITCH = 0.08
X = -6.0 + PITCH * np.arange(150)
Y = -4.0 + PITCH * np.arange(110)
POINTS = np.stack(np.meshgrid(X, Y), axis=-1)
DRIFT = np.stack([-(POINTS[..., 0] - 0.3) / 36.0, -(POINTS[..., 1] + 0.5) / 36.0], axis=-1)
LEDS = np.array([[0.5, 11.8, -13.7], [-10.4, -5.6, -13.9], [10.1, -6.3, -13.5]])
MATT = MembraneBrdf()
GLOSSY = MembraneBrdf(1.05, 0.25, 0.45)
_EVEN = np.linspace(0.0, 1.0, CURVE_NODES)
BENT = tuple(tuple((_EVEN * (1.0 + g * (1.0 - _EVEN))).tolist()) for g in (0.2, 0.35, 0.5))
CURVED = MembraneBrdf(diffuse=BENT)
SIGMA = 0.002


def bump(place: Array) -> tuple[Array, Array]:
    """Return depth and slopes at true positions: 1 mm deep, walls up to 45 degrees, lopsided."""
    u, v = place[..., 0] - 1.0, place[..., 1] + 0.6
    value = np.exp(-(u**2) / 2.2 - v**2 / 1.1)
    return value, np.stack([-2.0 * u / 2.2 * value, -2.0 * v / 1.1 * value], axis=-1)


def brightness(place: Array, normals: Array, view: Array, membrane: MembraneBrdf) -> Array:
    """Return what three Lambertian LEDs that look along +z give, (..., 3), dark side 0.

    Written from PHYSICS' shading and the GGX lobe of Walter et al. 2007, by angles.
    """
    shown = []
    for k, led in enumerate(LEDS):
        away = led - place
        r = np.sqrt((away**2).sum(-1))
        light = away / r[..., None]
        lit = (light * normals).sum(-1)
        half = light + view
        half /= np.sqrt((half**2).sum(-1))[..., None]
        seen, tilt = (view * normals).sum(-1), np.clip((half * normals).sum(-1), 0.0, 1.0)
        alpha = membrane.roughness
        facets = alpha**2 / np.pi / (1.0 - tilt**2 * (1.0 - alpha**2)) ** 2
        masks = []
        for cosine in (lit, seen):
            cosine = np.clip(cosine, 1e-3, 1.0)
            masks.append(2.0 / (1.0 + np.sqrt(1.0 + alpha**2 * (1.0 / cosine**2 - 1.0))))
        lobe = facets * masks[0] * masks[1] / (4.0 * seen)
        diffuse = np.clip(lit, 0.0, None) ** membrane.exponent / np.pi
        if membrane.diffuse:
            grazing = (0.2, 0.35, 0.5)[k]
            diffuse = np.clip(lit, 0.0, None) * (1.0 + grazing * (1.0 - lit)) / np.pi
        both = (1.0 - membrane.gloss) * diffuse + membrane.gloss * lobe
        strength = -light[..., 2] / r**2  # the LED's own cosine lobe, inverse square
        shown.append(np.where(lit > 0.0, both * strength, 0.0))
    return np.stack(shown, axis=-1)


def scene_of(membrane: MembraneBrdf) -> tuple[ShadedField, Array, Array]:
    """Return the image of the bump along the rays, its depth at each ray, and the normals."""
    depth = np.zeros(POINTS.shape[:2])
    for _ in range(80):
        depth, slopes = bump(POINTS + depth[..., None] * DRIFT)
    place = np.concatenate([POINTS + depth[..., None] * DRIFT, -depth[..., None]], axis=-1)
    normals = np.concatenate([-slopes, -np.ones((*depth.shape, 1))], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    view = np.concatenate([DRIFT, -np.ones((*depth.shape, 1))], axis=-1)
    view /= np.linalg.norm(view, axis=-1, keepdims=True)
    flat = np.concatenate([POINTS, np.zeros((*depth.shape, 1))], axis=-1)
    up = np.broadcast_to([0.0, 0.0, -1.0], flat.shape)
    ratio = brightness(place, normals, view, membrane) / brightness(flat, up, view, membrane)
    # Interreflected light that grows as the normal turns away from the camera.
    strength = membrane.interreflection * 0.5 * np.array([0.8, 1.1, 1.1])
    ratio = ratio + strength * (1.0 + normals[..., 2:])
    around = np.zeros((*ratio.shape[:2], 12))
    around[..., :3], around[..., 5::3] = strength, strength
    return field_of(ratio, DRIFT, X, Y, sigma=SIGMA, around=around), depth, normals


def solved(
    field: ShadedField, depth: Array, membrane: MembraneBrdf, *, workers: int = 1
) -> RaySlopes:
    return solve(field, depth.astype(np.float32), LEDS, membrane, workers=workers)


def slopes_of(found: RaySlopes) -> RegionSlopes:
    x, y, _ = (np.ascontiguousarray(n) for n in np.moveaxis(found.normals, -1, 0))
    return RegionSlopes(found.slope_x, found.slope_y, found.weight, found.flags, x, y)


def angle_deg(found: NDArray[np.float32], expected: Array) -> Array:
    """Return the angle between two fields of normals, (...)."""
    across = np.linalg.norm(np.cross(found.astype(float), expected), axis=-1)
    return np.asarray(np.degrees(np.arctan2(across, (found * expected).sum(-1))))


@pytest.mark.parametrize(
    "membrane",
    [
        MATT,
        MembraneBrdf(1.2),
        GLOSSY,
        replace(GLOSSY, interreflection=0.4),
        CURVED,
        replace(GLOSSY, diffuse=BENT),
    ],
    ids=["matt", "exponent", "glossy", "interreflection", "curves", "glossy curves"],
)
def test_known_normals_are_found(membrane):
    field, depth, normals = scene_of(membrane)
    found = solved(field, depth, membrane)
    error = angle_deg(found.normals, normals)
    # No noise: what is left is the last step's size, 5e-4, and single precision.
    assert error.max() < 0.1
    assert not found.flags.any()
    assert (found.weight == 1.0).all()
    np.testing.assert_allclose(np.linalg.norm(found.normals, axis=-1), 1.0, atol=1e-5)


def test_slopes_follow_the_rays_from_node_to_node():
    field, depth, _ = scene_of(MATT)
    found = solved(field, depth, MATT)
    slope_y, slope_x = np.gradient(depth, PITCH)
    inner = (slice(2, -2), slice(2, -2))
    # Central differences: pitch^2 / 6 times the third derivative, about 5 per mm^2.
    np.testing.assert_allclose(found.slope_x[inner], slope_x[inner], atol=8e-3)
    np.testing.assert_allclose(found.slope_y[inner], slope_y[inner], atol=8e-3)


@pytest.mark.parametrize("membrane", [MATT, GLOSSY], ids=["matt", "glossy"])
def test_the_stated_deviation_is_what_noise_does(membrane):
    field, depth, _ = scene_of(membrane)
    noise = 0.01
    ratio = np.ascontiguousarray(np.moveaxis(field.ratio, -1, 0))

    def again(moved: Map, start: tuple[Map, Map]) -> RegionSlopes:
        shaken = replace(field, ratio=np.moveaxis(moved, 0, -1))
        return slopes_of(solve(shaken, depth.astype(np.float32), LEDS, membrane, start=start))

    answer = slopes_of(solved(field, depth, membrane))
    moves = slope_noise(ratio, np.full_like(ratio, noise), answer, again)
    stated = np.sqrt((moves.moved**2).sum(axis=0))
    random = np.random.default_rng(4)
    slopes = []
    for _ in range(20):
        shaken = field.ratio + noise * random.normal(size=field.ratio.shape).astype(np.float32)
        normals = solved(replace(field, ratio=shaken), depth, membrane).normals
        slopes.append(normals[..., :2] / normals[..., 2:])
    seen = np.sqrt(np.var(slopes, axis=0, ddof=1).mean(axis=-1))
    # 20 repeats of two slopes know their scatter to 11 % at a node, and far better over many.
    for part in (depth < 0.02, depth > 0.3 * depth.max()):
        assert np.median(stated[part] / seen[part]) == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize("membrane", [MATT, GLOSSY], ids=["matt", "glossy"])
@pytest.mark.parametrize("channel", [0, 1, 2])
def test_a_wall_turned_away_from_one_light_is_found_by_the_other_two(membrane, channel):
    """Steep walls that do not see one light: nothing of it is left in the image."""
    field, depth, _ = scene_of(membrane)
    led = LEDS[channel]
    towards = led[:2] / np.linalg.norm(led[:2])
    # Turned away by 60 degrees, and sideways by 15, so that the two roots differ.
    away = -np.sin(np.radians(60)) * towards + 0.25 * np.array([-towards[1], towards[0]])
    normal = np.array([*away, -0.45])
    normal /= np.linalg.norm(normal)
    normals = np.broadcast_to(normal, (*depth.shape, 3))
    view = np.concatenate([DRIFT, -np.ones((*depth.shape, 1))], axis=-1)
    view /= np.linalg.norm(view, axis=-1, keepdims=True)
    flat = np.concatenate([POINTS, np.zeros((*depth.shape, 1))], axis=-1)
    up = np.broadcast_to([0.0, 0.0, -1.0], flat.shape)
    ratio = brightness(flat, normals, view, membrane) / brightness(flat, up, view, membrane)
    dark = (ratio[..., channel] == 0.0) & (np.delete(ratio, channel, axis=-1) > 0.1).all(axis=-1)
    assert dark.mean() > 0.3
    found = solved(replace(field, ratio=ratio.astype(np.float32)), 0.0 * depth, membrane)
    assert np.percentile(angle_deg(found.normals, normals)[dark], 99) < 1.0
    assert (found.flags[dark] == int(Flag.DARK)).all()
    assert (found.weight[dark] == 0.5).all()


@pytest.mark.parametrize("channel", [0, 1, 2])
def test_a_saturated_channel_is_missing_not_one(channel):
    """Walls turned towards a light saturate it; its cut value must not bend the normal."""
    field, depth, normals = scene_of(MATT)
    saturated = field.saturated.copy()
    saturated[..., channel] = field.ratio[..., channel] > 1.15
    ratio = field.ratio.copy()
    ratio[..., channel] = np.minimum(ratio[..., channel], 1.15)
    cut = replace(field, ratio=ratio, saturated=saturated)
    found = solved(cut, depth, MATT)
    lost = saturated[..., channel]
    assert lost.sum() > 100
    assert ((found.flags[lost] & int(Flag.SATURATED)) != 0).all()
    assert (found.weight[lost] < 1.0).all()
    assert np.percentile(angle_deg(found.normals, normals)[lost], 95) < 1.0
    believed = solved(replace(field, ratio=ratio), depth, MATT)
    assert angle_deg(believed.normals, normals)[lost].max() > 1.5
    kept = ~lost
    assert angle_deg(found.normals, normals)[kept].max() < 0.1


def test_an_all_black_image_is_flat_flagged_and_hardly_counts():
    field, depth, _ = scene_of(GLOSSY)
    found = solved(replace(field, ratio=0.0 * field.ratio), depth, GLOSSY)
    assert ((found.flags & int(Flag.DARK)) != 0).all()
    assert (found.weight <= 0.01 + 1e-6).all()
    np.testing.assert_array_equal(found.normals, np.broadcast_to([0, 0, -1], found.normals.shape))
    assert not found.slope_x.any()
    assert not found.slope_y.any()


def test_outside_is_firm_flat_ground_and_a_hole_inside_is_led_by_what_is_around():
    field, depth, normals = scene_of(MATT)
    inside = (POINTS[..., 0] - 1.0) ** 2 + POINTS[..., 1] ** 2 < 9.0
    hole = (POINTS[..., 0] - 1.5) ** 2 + (POINTS[..., 1] - 0.5) ** 2 < 0.2
    found = solved(replace(field, usable=inside & ~hole, inside=inside), depth, MATT)
    for lost, flag in ((~inside, Flag.OUTSIDE), (hole, Flag.OUTSIDE | Flag.INVALID)):
        assert (found.flags[lost] == int(flag)).all()
        assert not found.slope_x[lost].any()
    assert (found.weight[~inside] == 1.0).all()
    assert (found.weight[hole] < 0.05).all()
    assert angle_deg(found.normals, normals)[inside & ~hole].max() < 0.1


def test_walls_steeper_than_can_be_seen_are_held_and_flagged():
    field, depth, _ = scene_of(MATT)
    ratio = np.zeros_like(field.ratio)
    ratio[..., 1] = ratio[..., 2] = 3.0  # brighter than any wall
    found = solved(replace(field, ratio=ratio), depth, MATT)
    assert (found.normals[..., 2] <= -0.149).all()
    steep = found.normals[..., 2] > -0.1501
    assert ((found.flags[steep] & int(Flag.NOT_OBSERVABLE)) != 0).all()
    assert np.isfinite(found.slope_x).all()


def test_a_channel_seen_at_a_cosine_that_no_ball_showed_is_flagged():
    field, depth, normals = scene_of(MATT)
    place = np.concatenate([POINTS + depth[..., None] * DRIFT, -depth[..., None]], axis=-1)
    away = LEDS[1] - place
    cosines = (away * normals).sum(-1) / np.linalg.norm(away, axis=-1)
    limit = float(np.percentile(cosines, 90))
    coverage = ((-1.0, 2.0), (-1.0, limit), (-1.0, 2.0))
    flags = solve(field, depth.astype(np.float32), LEDS, MATT, coverage=coverage).flags
    far = (flags & int(Flag.EXTRAPOLATED)) != 0
    clear = np.abs(cosines - limit) > 1e-3
    np.testing.assert_array_equal(far[clear], (cosines > limit)[clear])
    assert far[clear].any()
