"""Parts of the compiled solve: its start, its flags, and the sampling of images."""

from __future__ import annotations

import compiled
import numpy as np
from compiled import ShadedField
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from gelpolight_core.reconstruction.height_map import Flag
from gelpolight_core.reconstruction.near_light.maps import light_levels
from gelpolight_core.reconstruction.near_light.sampling import sample_rows
from gelpolight_core.reconstruction.near_light.structures import RatioImage
from gelpolight_core.reflectance.membrane import CURVE_NODES, Membrane

Array = NDArray[np.float64]
Map = NDArray[np.float32]
ROWS, COLUMNS, PITCH = 70, 90, 0.1
X = -4.0 + PITCH * np.arange(COLUMNS)
Y = -3.0 + PITCH * np.arange(ROWS)
POINTS = np.stack(np.meshgrid(X, Y), axis=-1)
DRIFT = -(POINTS - np.array([0.4, -0.7])) / np.array([28.0, 33.0])
LEDS = np.array([[0.5, 11.8, -13.7], [-10.4, -5.6, -13.9], [10.1, -6.3, -13.5]])
_EVEN = np.linspace(0.0, 1.0, CURVE_NODES)
BENT = tuple(tuple((_EVEN * (1.0 + g * (1.0 - _EVEN))).tolist()) for g in (0.2, 0.35, 0.5))

# Each kind of membrane is compiled by itself: these two stand for all.
membranes = st.one_of(
    st.builds(Membrane, st.floats(0.9, 1.3)),
    st.builds(
        Membrane,
        st.floats(0.9, 1.3),
        st.floats(0.05, 0.5),
        st.floats(0.3, 0.7),
        st.floats(0.1, 0.9),
    ),
)


def dented(membrane: Membrane, seed: int) -> tuple[ShadedField, Map]:
    """Return a noisy image of dents with walls up to 60 degrees, shadows in it, and a depth."""
    random = np.random.default_rng(seed)
    depth = np.zeros((ROWS, COLUMNS))
    slopes = np.zeros((ROWS, COLUMNS, 2))
    for _ in range(3):
        off = POINTS - random.uniform([-3.0, -2.0], [4.0, 3.0])
        wide, deep = random.uniform(0.5, 1.5), random.uniform(0.2, 0.9)
        dent = deep * np.exp(-(off**2).sum(-1) / (2.0 * wide**2))
        depth, slopes = depth + dent, slopes - off / wide**2 * dent[..., None]
    normals = np.concatenate([-slopes, -np.ones((ROWS, COLUMNS, 1))], axis=-1).reshape(-1, 3)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    view = np.concatenate([DRIFT, -np.ones((ROWS, COLUMNS, 1))], axis=-1).reshape(-1, 3)
    view /= np.linalg.norm(view, axis=-1, keepdims=True)
    flat = np.tile([0.0, 0.0, -1.0], (ROWS * COLUMNS, 1))
    light = LEDS - np.append(POINTS, np.zeros((ROWS, COLUMNS, 1)), axis=-1).reshape(-1, 1, 3)
    light /= np.linalg.norm(light, axis=-1, keepdims=True)
    ratio = membrane.response(light, normals, view) / membrane.response(light, flat, view)
    ratio = ratio.reshape(ROWS, COLUMNS, 3) * random.normal(1.0, 0.004, (ROWS, COLUMNS, 3))
    around = random.uniform(0.7, 1.2, 3) * np.ones_like(ratio)
    around *= membrane.interreflection * 0.5 * (1.0 + normals[:, 2].reshape(ROWS, COLUMNS, 1))
    ratio += around
    usable = random.random((ROWS, COLUMNS)) > 0.01
    field = ShadedField(
        ratio.astype(np.float32),
        np.full(ratio.shape, 0.004, np.float32),
        around.astype(np.float32),
        random.random(ratio.shape) > 0.98,
        usable,
        usable | (random.random(usable.shape) > 0.5),
        DRIFT.astype(np.float32),
        X,
        Y,
    )
    return field, depth.astype(np.float32)


def test_a_channel_seen_at_a_cosine_that_no_ball_showed_is_flagged() -> None:
    membrane = Membrane()
    field, depth = dented(membrane, 3)
    found = compiled.solve(field, depth, LEDS, membrane)
    place = np.concatenate([POINTS + depth[..., None] * DRIFT, -depth[..., None]], axis=-1)
    away = LEDS - place[..., None, :]
    away /= np.linalg.norm(away, axis=-1, keepdims=True)
    cosines = (away * found.normals[..., None, :]).sum(-1)
    counts = field.usable & (found.flags == 0)
    limit = float(np.percentile(cosines[counts], 90))
    coverage = ((-1.0, 2.0), (-1.0, limit), (-1.0, 2.0))
    flagged = compiled.solve(field, depth, LEDS, membrane, coverage=coverage).flags
    far = (flagged & int(Flag.EXTRAPOLATED)) != 0
    clear = counts & (np.abs(cosines[..., 1] - limit) > 1e-3)
    np.testing.assert_array_equal(far[clear], (cosines[..., 1] > limit)[clear])
    assert far[clear].any()


def sampled(
    raw: NDArray[np.uint8] | NDArray[np.uint16],
    place: tuple[Map, Map],
    background: Map,
    mix: Map,
    *,
    wide: bool,
    coded: bool = False,
) -> RatioImage:
    """Compare a raw image with a background at the given pixels."""
    shape = place[0].shape
    planes = [np.empty((3, *shape), np.float32) for _ in range(2)]
    nothing = np.zeros((3, 1, 1), np.float32)
    image = RatioImage(planes[0], planes[1], nothing, np.empty(shape, np.uint8))
    light = light_levels(None, raw.dtype, coded=coded)
    sensor = (tuple(tuple(row) for row in mix), (np.float32(0.01),) * 3)
    kind, limit = np.full(shape, 2, np.uint8), np.float32(0.995)
    source = (*place, background)
    sample_rows(0, shape[0], raw, light, limit, source, wide, sensor, kind, (0, 0), image)
    return image


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 999), st.sampled_from([np.uint8, np.uint16]), st.booleans())
def test_a_node_sees_the_pixels_about_it(seed: int, kind: type, wide: bool) -> None:
    """Bilinear, at the coarser scales in an image that was averaged over 2 x 2 pixels."""
    random = np.random.default_rng(seed)
    top = np.iinfo(kind).max
    raw = random.integers(0, int(0.99 * top), (40, 50, 3)).astype(kind)
    u, v = (random.uniform(1.0, n - 2.0, (12, 14)).astype(np.float32) for n in (50, 40))
    mix = np.linalg.inv(np.eye(3) + 0.05 * random.random((3, 3))).astype(np.float32)
    background = random.uniform(0.3, 1.0, (12, 14, 3)).astype(np.float32)
    found = sampled(raw, (u, v), background, mix, wide=wide)
    even = (raw / np.float32(top)).astype(np.float64)
    if wide:
        even = 0.25 * (even[1:, 1:] + even[:-1, 1:] + even[1:, :-1] + even[:-1, :-1])
    shift = 0.5 if wide else 0.0
    at = [v.astype(np.float64) - shift, u.astype(np.float64) - shift]
    seen = np.stack([map_coordinates(even[..., k], at, order=1) for k in range(3)], axis=-1)
    expected = np.moveaxis(seen @ mix.T / background, -1, 0)
    np.testing.assert_allclose(found.ratio, expected, atol=2e-4)
    np.testing.assert_allclose(found.noise, np.moveaxis(0.01 / background, -1, 0), rtol=1e-5)
    assert not found.marks.any()


def test_a_strong_lobe_does_not_lead_a_solve_astray() -> None:
    """Brightness under a lobe is the same at two slopes; only one of them fits all three lights."""
    membrane = Membrane(1.0, 0.53, 0.35)
    leds = np.array([[-5.35, 11.29, -9.74], [-10.84, -4.1, -9.86], [5.18, -1.04, -9.83]])
    middle, radius, deep = np.array([0.5, 0.4]), 4.0, 0.6
    off = POINTS - middle
    cap = np.sqrt(np.maximum(radius**2 - (off**2).sum(-1), 0.01))
    depth = np.maximum(deep - radius + cap, 0.0)
    pressed = depth > 0.0
    slopes = np.where(pressed[..., None], -off / cap[..., None], 0.0)
    normals = np.concatenate([-slopes, -np.ones((ROWS, COLUMNS, 1))], axis=-1)
    normals /= np.linalg.norm(normals, axis=-1, keepdims=True)
    ratio = _shaded(membrane, leds, depth, normals) / _shaded(
        membrane, leds, np.zeros_like(depth), np.zeros_like(normals) - [0.0, 0.0, 1.0]
    )
    field = ShadedField(
        ratio.astype(np.float32),
        np.full(ratio.shape, 0.004, np.float32),
        np.zeros_like(ratio, np.float32),
        np.zeros(ratio.shape, np.bool_),
        np.ones((ROWS, COLUMNS), np.bool_),
        np.ones((ROWS, COLUMNS), np.bool_),
        np.zeros_like(DRIFT, np.float32),
        X,
        Y,
    )
    for steps in (compiled.BEST, compiled.QUICK):
        found = compiled.solve(field, depth.astype(np.float32), leds, membrane, steps=steps)
        astray = np.linalg.norm(found.normals - normals, axis=-1)[pressed] > 0.05
        assert astray.mean() < 0.03


def _shaded(membrane: Membrane, leds: Array, depth: Array, normals: Array) -> Array:
    """Return the brightness of a surface seen from straight below, near-light included."""
    place = np.concatenate([POINTS, -depth[..., None]], axis=-1).reshape(-1, 1, 3)
    away = leds - place
    distance = np.linalg.norm(away, axis=-1)
    light = away / distance[..., None]
    view = np.tile([0.0, 0.0, -1.0], (len(place), 1))  # the camera is far away
    bright = membrane.response(light, normals.reshape(-1, 3), view)
    return np.asarray((bright * -light[..., 2] / distance**2).reshape(*depth.shape, 3))
