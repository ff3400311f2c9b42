"""Parts of the compiled solve: its start, its flags, and the sampling of images."""

import compiled
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from gelpolight_core.image.coded import LightLevels
from gelpolight_core.light.membrane_brdf import MembraneBrdf
from gelpolight_core.reconstruction.near_light.kernel_structures import RatioImage
from gelpolight_core.reconstruction.near_light.ratio_sampler import sample_rows

Array = NDArray[np.float64]
Map = NDArray[np.float32]
ROWS, COLUMNS, PITCH = 70, 90, 0.1
X = -4.0 + PITCH * np.arange(COLUMNS)
Y = -3.0 + PITCH * np.arange(ROWS)
POINTS = np.stack(np.meshgrid(X, Y), axis=-1)
DRIFT = -(POINTS - np.array([0.4, -0.7])) / np.array([28.0, 33.0])
LEDS = np.array([[0.5, 11.8, -13.7], [-10.4, -5.6, -13.9], [10.1, -6.3, -13.5]])


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
    light = LightLevels(None)(raw.dtype, coded)
    sensor = (tuple(tuple(row) for row in mix), (np.float32(0.01),) * 3)
    kind, limit = np.full(shape, 2, np.uint8), np.float32(0.995)
    source = (*place, background)
    sample_rows(0, shape[0], raw, light, limit, source, wide, sensor, kind, (0, 0), image)
    return image


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 999), st.sampled_from([np.uint8, np.uint16]), st.booleans())
def test_a_node_sees_the_pixels_about_it(seed, kind, wide):
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


def test_a_strong_lobe_does_not_lead_a_solve_astray():
    """Brightness under a lobe is the same at two slopes; only one of them fits all three lights."""
    membrane = MembraneBrdf(1.0, 0.53, 0.35)
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
    field = compiled.field_of(ratio, np.zeros_like(POINTS), X, Y, sigma=0.004, around=0.0)
    for steps in (compiled.BEST, compiled.QUICK):
        found = compiled.solve(field, depth.astype(np.float32), leds, membrane, steps=steps)
        astray = np.linalg.norm(found.normals - normals, axis=-1)[pressed] > 0.05
        assert astray.mean() < 0.03


def _shaded(membrane: MembraneBrdf, leds: Array, depth: Array, normals: Array) -> Array:
    """Return the brightness of a surface seen from straight below, near-light included."""
    place = np.concatenate([POINTS, -depth[..., None]], axis=-1).reshape(-1, 1, 3)
    away = leds - place
    distance = np.linalg.norm(away, axis=-1)
    light = away / distance[..., None]
    view = np.tile([0.0, 0.0, -1.0], (len(place), 1))  # the camera is far away
    bright = membrane.response(light, normals.reshape(-1, 3), view)
    return np.asarray((bright * -light[..., 2] / distance**2).reshape(*depth.shape, 3))
