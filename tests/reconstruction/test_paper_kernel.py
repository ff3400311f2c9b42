"""The paper's model in wide instructions is the model, for images and grids of any size."""

from __future__ import annotations

import numpy as np
import pytest
import scene
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gelpolight_core.reconstruction.height_map import Flag
from gelpolight_core.reconstruction.integration.poisson import PoissonSolver
from gelpolight_core.reconstruction.paper.model import ShadingMaps, SlopeField, SlopeSolver
from gelpolight_core.reconstruction.threads import RowWorkers

Array = NDArray[np.float64]
GRIDS = st.tuples(st.integers(1, 9), st.integers(1, 150))
IMAGES = st.tuples(st.integers(1, 20), st.integers(1, 30))
KINDS = st.sampled_from([np.uint8, np.uint16, np.float32])
SEEDS = st.integers(0, 2**32 - 1)
WORKERS = {n: RowWorkers(n) for n in (1, 2, 3)}


def maps_of(grid: tuple[int, int], image: tuple[int, int], seed: int) -> ShadingMaps:
    """Return maps of nodes all over the image and beyond it, some without light or factor."""
    random = np.random.default_rng(seed)
    where = [np.float32(random.uniform(-0.2 * n, n - 1.0, grid)) for n in image]
    for place, size in zip(where, image, strict=True):
        # Also on pixels, on the last ones, and where no ray ends.
        known = random.random(grid)
        place[known < 0.2] = np.rint(np.maximum(place[known < 0.2], 0.0))
        place[known < 0.1] = size - 1
        place[known > 0.98] = np.nan
    gain = random.uniform(1.2, 3.0, (*grid, 3)).astype(np.float32)
    gain[random.random(grid) < 0.1] = 0.0
    lookup = np.sqrt(np.linspace(0.0, 1.0, 65)) * np.array([[1.0], [0.9], [0.95]])
    return ShadingMaps(
        u_px=where[1],
        v_px=where[0],
        gain=gain,
        lookup=lookup.astype(np.float32),
        lookup_scale=np.float32([40.0, 50.0, 64.0]),
        coverage=np.float32([[0.1, 0.9], [0.15, 0.95], [0.2, 0.85]]),
        leds_mm=scene.LEDS.astype(np.float32),
        x_mm=np.linspace(-9.0, 9.0, grid[1]).astype(np.float32),
        y_mm=np.linspace(-7.0, 7.0, grid[0]).astype(np.float32),
    )


def image_of(size: tuple[int, int], kind: type, seed: int) -> NDArray[np.generic]:
    """Return light of every strength, with black and saturated pixels."""
    light = np.random.default_rng(seed + 1).uniform(-0.1, 1.1, (*size, 3)).clip(0.0, 1.0)
    if kind is np.float32:
        light[light > 0.98] = np.nan
        return light.astype(np.float32)
    top = np.iinfo(kind).max
    return np.rint(light * top).astype(kind)


def by_numpy(raw: NDArray[np.generic], maps: ShadingMaps) -> tuple[Array, Array, Array, Array]:
    """Return slopes (..., 2), flags, length error and what is too close to a limit to be judged.

    Array by array in double precision.
    """
    light = raw / (1.0 if raw.dtype.kind == "f" else np.iinfo(raw.dtype).max)
    usable = (maps.gain > 0.0).all(axis=-1) & (maps.u_px >= 0.0) & (maps.v_px >= 0.0)
    u, v = (np.where(usable, a, 0.0).astype(float) for a in (maps.u_px, maps.v_px))
    height, width = light.shape[:2]
    c, r = (
        np.clip(u.astype(int), 0, max(width - 2, 0)),
        np.clip(v.astype(int), 0, max(height - 2, 0)),
    )
    c1, r1 = np.minimum(c + 1, width - 1), np.minimum(r + 1, height - 1)
    fu, fv = (u - c)[..., None], (v - r)[..., None]
    corners = np.stack([light[r, c], light[r, c1], light[r1, c], light[r1, c1]])
    shares = np.stack([(1 - fu) * (1 - fv), fu * (1 - fv), (1 - fu) * fv, fu * fv])
    place = (corners * shares).sum(axis=0) * maps.gain * maps.lookup_scale
    missing = np.isnan(place)
    steps = np.arange(maps.lookup.shape[1])
    cosine = np.stack(
        [np.interp(np.where(missing, 0.0, place)[..., k], steps, maps.lookup[k]) for k in range(3)],
        axis=-1,
    )
    points = np.stack(np.meshgrid(maps.x_mm, maps.y_mm), axis=-1).astype(float)
    to_led = (
        maps.leds_mm - np.append(points, np.zeros((*points.shape[:2], 1)), axis=-1)[..., None, :]
    )
    direction = to_led / np.linalg.norm(to_led, axis=-1, keepdims=True)
    normal = np.linalg.solve(direction, cosine[..., None])[..., 0]
    length = np.linalg.norm(normal, axis=-1)
    hidden = ~(normal[..., 2] < -0.1 * length)
    nz = np.where(hidden, -0.1 * length, normal[..., 2])
    slopes = normal[..., :2] / np.where(length > 0.0, nz, 1.0)[..., None]
    low, high = maps.coverage[:, 0], maps.coverage[:, 1]
    dark = cosine < 0.03
    far = (place > steps[-1]) | (~dark & ((cosine < low) | (cosine > high)))
    flags = Flag.SATURATED * (np.nan_to_num(corners) >= 0.995).any(axis=(0, -1))
    flags = flags + Flag.DARK * dark.any(axis=-1) + Flag.EXTRAPOLATED * far.any(axis=-1)
    flags += Flag.NOT_OBSERVABLE * hidden + Flag.INVALID * (missing.any(axis=-1) | (length == 0.0))
    flags[~usable], slopes[~usable] = Flag.OUTSIDE, 0.0
    limits = np.stack([cosine - 0.03, cosine - low, cosine - high, place - steps[-1]])
    close = (np.abs(limits) < 1e-4).any(axis=(0, -1)) | (
        np.abs(normal[..., 2] + 0.1 * length) < 1e-4
    )
    return slopes, flags, np.where(usable, np.abs(length - 1.0), 0.0), close


@settings(max_examples=30, deadline=None)
@example((1, 1), (1, 1), np.uint8, 0)
@example((3, 64), (2, 2), np.uint8, 1)
@example((2, 129), (1, 7), np.uint8, 2)
@example((2, 65), (7, 1), np.uint16, 3)
@given(GRIDS, IMAGES, KINDS, SEEDS)
def test_blocks_of_nodes_are_solved_as_plain_arrays_are(
    grid: tuple[int, int], image: tuple[int, int], kind: type, seed: int
) -> None:
    maps, raw = maps_of(grid, image, seed), image_of(image, kind, seed)
    field = SlopeSolver(maps, WORKERS[2]).solve(raw)
    slopes, flags, length, close = by_numpy(raw, maps)
    # Single precision, of which a steep slope loses the more the steeper it is.
    allowed = 3e-5 * (1.0 + (slopes**2).sum(axis=-1))
    for found, expected in ((field.slope_x, slopes[..., 0]), (field.slope_y, slopes[..., 1])):
        assert (np.abs(found - expected)[~close] <= allowed[~close]).all()
    np.testing.assert_array_equal(field.flags[~close], flags[~close])
    np.testing.assert_allclose(field.length_error, length, atol=1e-4)


@settings(max_examples=12, deadline=None)
@given(GRIDS, IMAGES, KINDS, SEEDS)
def test_any_number_of_threads_and_any_run_gives_the_same_bits(
    grid: tuple[int, int], image: tuple[int, int], kind: type, seed: int
) -> None:
    maps, raw = maps_of(grid, image, seed), image_of(image, kind, seed)
    one = SlopeSolver(maps, WORKERS[1]).solve(raw)
    for workers in WORKERS.values():
        solver = SlopeSolver(maps, workers)
        assert same(one, solver.solve(raw))
        assert same(one, solver.solve(raw))


def same(one: SlopeField, other: SlopeField) -> bool:
    return all(
        getattr(one, name).tobytes() == getattr(other, name).tobytes()
        for name in ("slope_x", "slope_y", "flags", "length_error")
    )


@pytest.mark.parametrize("kind", [np.uint8, np.float32])
def test_an_image_is_left_as_it_was_and_may_be_a_view(kind: type) -> None:
    maps, raw = maps_of((9, 100), (20, 30), 5), image_of((20, 60), kind, 5)
    raw.flags.writeable = False
    before, solver = raw.copy(), SlopeSolver(maps, WORKERS[1])
    assert same(solver.solve(raw[:, ::2]), solver.solve(np.ascontiguousarray(raw[:, ::2])))
    np.testing.assert_array_equal(raw, before)


@settings(max_examples=12, deadline=None)
@given(GRIDS, IMAGES, KINDS, SEEDS)
def test_one_pass_to_the_divergence_is_slopes_and_then_integration(
    grid: tuple[int, int], image: tuple[int, int], kind: type, seed: int
) -> None:
    """Whatever the threads; grids of seven lines and more are padded."""
    maps, raw = maps_of(grid, image, seed), image_of(image, kind, seed)
    poisson = PoissonSolver(*grid, pitch_mm=0.1)
    slopes = SlopeSolver(maps, WORKERS[1]).solve(raw)
    expected = poisson.integrate(slopes.slope_x, slopes.slope_y).depth_mm
    for workers in WORKERS.values():
        solver = SlopeSolver(maps, workers)
        divergence, found = solver.divergence(raw, poisson, slopes=True)
        np.testing.assert_array_equal(found.flags, slopes.flags)
        np.testing.assert_array_equal(found.slope_x, slopes.slope_x)
        np.testing.assert_array_equal(found.slope_y, slopes.slope_y)
        again, bare = solver.divergence(raw, poisson)
        np.testing.assert_array_equal(again, divergence)
        assert bare.slope_x.size == 0
        scale = 1.0 + np.abs(expected).max()
        np.testing.assert_allclose(poisson.depth_of(divergence), expected, atol=1e-5 * scale)
