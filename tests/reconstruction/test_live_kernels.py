"""The compiled parts of the planned reconstruction do what their plain counterparts do."""

from __future__ import annotations

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gelpolight_core.calibration.calibration import FullModel
from gelpolight_core.reconstruction.heightmap import Flag
from gelpolight_core.reconstruction.live_integration import integrate_live
from gelpolight_core.reconstruction.live_kernel import solve_rows
from gelpolight_core.reconstruction.live_maps import live_membrane, static_maps
from gelpolight_core.reconstruction.live_pixels import block_means, halve, place_rows, sample_rows
from gelpolight_core.reconstruction.near_light import ShadedField, solve_near_light
from gelpolight_core.reconstruction.placement import place_on_grid, resample
from gelpolight_core.reconstruction.threads import RowWorkers
from gelpolight_core.reconstruction.weighted import integrate_weighted
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


def full_model(membrane: Membrane) -> FullModel:
    nothing = np.zeros((ROWS, COLUMNS, 3), np.float32)
    return FullModel(LEDS, 0.0 * LEDS, membrane, nothing, 0.7, 0.01, (0.0, 0.0), "mirror")


def dented(membrane: Membrane, seed: int) -> tuple[ShadedField, Map]:
    """Return a noisy picture of dents with walls up to 60 degrees, shadows in it, and a depth."""
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
    ratio += membrane.bounce * around * 0.5 * (1.0 + normals[:, 2].reshape(ROWS, COLUMNS, 1))
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


def solved_in_blocks(
    field: ShadedField, depth: Map, membrane: Membrane, start: tuple[Map, Map] | None = None
) -> dict[str, NDArray]:  # type: ignore[type-arg]
    planes = [np.moveaxis(a, -1, 0) for a in (field.ratio, field.around, field.sigma)]
    ratio, around, sigma = (np.ascontiguousarray(a, np.float32) for a in planes)
    drift = np.moveaxis(field.drift, -1, 0).astype(np.float64)
    static = static_maps(full_model(membrane), X, Y, drift, sigma)
    bits = (field.saturated * np.array([1, 2, 4])).sum(axis=-1).astype(np.uint8)
    kind = np.where(field.usable, 2, field.inside).astype(np.uint8)
    live = live_membrane(full_model(membrane))
    names = ("slope_x", "slope_y", "weight", "flags", "normal_x", "normal_y")
    out = {n: np.zeros(depth.shape, np.uint8 if n == "flags" else np.float32) for n in names}
    if start is not None:
        out["normal_x"], out["normal_y"] = (values.copy() for values in start)
    solve_rows(
        0,
        ROWS,
        ratio,
        around,
        bits,
        depth,
        static,
        kind,
        (0, 0),
        (float(X[0]), float(Y[0])),
        PITCH,
        live.leds,
        live.dark,
        live.curves,
        live.gloss,
        live.bounce,
        True,
        start is not None,
        *out.values(),
    )
    return out


@settings(max_examples=12, deadline=None)
@given(membranes, st.booleans(), st.integers(0, 999))
def test_the_fast_solve_finds_the_normals_of_the_plain_one(
    membrane: Membrane, bent: bool, seed: int
) -> None:
    """In single precision, by a polynomial, with as many steps as a block needs.

    Nodes at the edge of darkness may fall to either side of it.
    """
    if bent:
        membrane = Membrane(gloss=membrane.gloss, bounce=membrane.bounce, diffuse=BENT)
    field, depth = dented(membrane, seed)
    plain = solve_near_light(field, depth, LEDS, membrane)
    fast = solved_in_blocks(field, depth, membrane)
    for name in ("slope_x", "slope_y"):
        off = np.abs(fast[name] - getattr(plain, name))[2:-2, 2:-2]
        assert np.percentile(off, 95) < 5e-3
        assert np.isfinite(fast[name]).all()
    assert (fast["flags"] == plain.flags).mean() > 0.99
    assert (fast["weight"] == plain.weight).mean() > 0.99
    length = fast["normal_x"] ** 2 + fast["normal_y"] ** 2
    assert (length <= 1.0).all()


@settings(max_examples=6, deadline=None)
@given(membranes, st.integers(0, 999))
def test_a_start_from_other_normals_ends_at_the_same(membrane: Membrane, seed: int) -> None:
    field, depth = dented(membrane, seed)
    cold = solved_in_blocks(field, depth, membrane)
    random = np.random.default_rng(seed)
    near = tuple(
        np.clip(cold[n] + random.normal(0.0, 0.05, depth.shape), -0.7, 0.7).astype(np.float32)
        for n in ("normal_x", "normal_y")
    )
    warm = solved_in_blocks(field, depth, membrane, (near[0], near[1]))
    for name in ("slope_x", "slope_y"):
        off = np.abs(warm[name] - cold[name])[2:-2, 2:-2]
        assert np.percentile(off, 95) < 2e-3


def test_nodes_without_membrane_are_flat_and_flagged() -> None:
    field, depth = dented(Membrane(), 1)
    fast = solved_in_blocks(field, depth, Membrane())
    outside = ~field.usable
    assert (fast["flags"][outside] == Flag.OUTSIDE).all()
    assert (fast["slope_x"][outside] == 0.0).all()


@settings(max_examples=10, deadline=None)
@given(st.integers(0, 999), st.booleans(), st.booleans())
def test_the_fast_integration_is_the_plain_one(seed: int, let_go: bool, started: bool) -> None:
    random = np.random.default_rng(seed)
    bump = cv2.GaussianBlur(random.normal(size=(ROWS, COLUMNS)).astype(np.float32), (0, 0), 6.0)
    slope_y, slope_x = (np.gradient(2.0 * bump, PITCH, axis=axis) for axis in (0, 1))
    weight = np.where(random.random(bump.shape) > 0.1, 1.0, 0.01).astype(np.float32)
    hold = np.ones_like(weight)
    if let_go:
        hold[:, -20:] = 1e-3
    plain = integrate_weighted(slope_x, slope_y, weight, pitch_mm=PITCH, hold=hold, tolerance=1e-5)
    fast = integrate_live(
        slope_x,
        slope_y,
        weight,
        pitch_mm=PITCH,
        start_mm=bump if started else None,
        hold=hold if let_go else None,
        tolerance=1e-5,
        workers=RowWorkers(1),
    )
    assert np.abs(fast.depth_mm - plain.depth_mm).max() < 1e-3 * np.abs(plain.depth_mm).max()


def test_a_solution_to_start_from_needs_no_round() -> None:
    random = np.random.default_rng(4)
    slopes = [random.normal(0.0, 0.1, (ROWS, COLUMNS)).astype(np.float32) for _ in range(2)]
    weight = random.uniform(0.2, 1.0, (ROWS, COLUMNS)).astype(np.float32)
    first = integrate_live(
        *slopes,
        weight,
        pitch_mm=PITCH,
        start_mm=None,
        hold=None,
        tolerance=1e-4,
        workers=RowWorkers(1),
    )
    again = integrate_live(
        *slopes,
        weight,
        pitch_mm=PITCH,
        start_mm=first.depth_mm,
        hold=None,
        tolerance=1e-3,
        workers=RowWorkers(1),
    )
    assert first.rounds > 1
    assert again.rounds == 0


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 999), st.floats(0.1, 1.2))
def test_true_positions_are_those_of_the_plain_way(seed: int, deep: float) -> None:
    """Within a hundredth of a node times the steepest slope, where no wall hides the surface."""
    random = np.random.default_rng(seed)
    off = POINTS - random.uniform([-2.0, -1.0], [3.0, 2.0])
    depth = (deep * np.exp(-(off**2).sum(-1) / 1.5)).astype(np.float32)
    column, row, folded = place_on_grid(depth, DRIFT.astype(np.float32), X, Y)
    static = np.zeros((12, ROWS, COLUMNS), np.float32)
    static[6:8] = np.moveaxis(DRIFT, -1, 0)
    static[8], static[11] = -1.0 / 28.0, -1.0 / 33.0
    flags, marks = np.zeros(depth.shape, np.uint8), np.zeros(depth.shape, np.uint8)
    placed, place = np.empty_like(depth), np.empty((2, *depth.shape), np.float32)
    scale = np.float32(1.0 / PITCH)
    place_rows(0, ROWS, depth, static, (0, 0), scale, flags, 16, placed, marks, place)
    assert not folded.any()
    assert not marks.any()
    off_by = np.abs(placed - resample(depth, column, row))[3:-3, 3:-3]
    assert off_by.max() < 2e-3


@settings(max_examples=8, deadline=None)
@given(st.integers(0, 999), st.sampled_from([np.uint8, np.uint16]))
def test_a_node_sees_the_average_of_the_pixels_about_it(seed: int, kind: type) -> None:
    """As bilinear sampling of a picture that was averaged over 2 x 2 pixels."""
    random = np.random.default_rng(seed)
    top = np.iinfo(kind).max
    raw = random.integers(0, top, (40, 50, 3)).astype(kind)
    u, v = (random.uniform(1.0, n - 2.0, (12, 14)).astype(np.float32) for n in (50, 40))
    light = np.tile((np.arange(top + 1) / np.float32(top)).astype(np.float32), (3, 1))
    mix = np.linalg.inv(np.eye(3) + 0.05 * random.random((3, 3))).astype(np.float32)
    gain = random.uniform(1.0, 3.0, (3, 12, 14)).astype(np.float32)
    ratio, bits = np.empty((3, 12, 14), np.float32), np.empty((12, 14), np.uint8)
    usable = np.full((12, 14), 2, np.uint8)
    rows = tuple(tuple(row) for row in mix)
    limit = np.float32(2.0)
    sample_rows(0, 12, raw, light, limit, u, v, rows, gain, usable, (0, 0), ratio, bits)
    even = (raw / np.float32(top)).astype(np.float32)
    even = 0.25 * (even[1:, 1:] + even[:-1, 1:] + even[1:, :-1] + even[:-1, :-1])
    seen = cv2.remap(even, u - 0.5, v - 0.5, cv2.INTER_LINEAR) @ mix.T
    # OpenCV knows 32 places between two pixels.
    np.testing.assert_allclose(np.moveaxis(ratio, 0, -1), seen * np.moveaxis(gain, 0, -1), atol=0.1)
    assert np.abs(np.moveaxis(ratio, 0, -1) - seen * np.moveaxis(gain, 0, -1)).mean() < 0.02
    assert not bits.any()


def test_a_saturated_pixel_marks_its_channel_in_the_nodes_about_it() -> None:
    raw = np.zeros((20, 20, 3), np.uint8)
    raw[10, 10, 1] = 255
    u, v = (a.astype(np.float32) for a in np.meshgrid(np.arange(16.0), np.arange(16.0)))
    light = np.tile((np.arange(256) / np.float32(255)).astype(np.float32), (3, 1))
    rows = tuple(tuple(row) for row in np.eye(3, dtype=np.float32))
    ratio, bits = np.empty((3, 16, 16), np.float32), np.empty((16, 16), np.uint8)
    gain, usable = np.ones((3, 16, 16), np.float32), np.full((16, 16), 2, np.uint8)
    limit = np.float32(0.995)
    sample_rows(0, 16, raw, light, limit, u, v, rows, gain, usable, (0, 0), ratio, bits)
    assert set(np.unique(bits)) == {0, 2}
    assert bits[10, 10] == 2
    assert (bits > 0).sum() <= 9
    small, small_bits = np.empty((3, 8, 8), np.float32), np.empty((8, 8), np.uint8)
    halve(ratio, bits, small, small_bits)
    np.testing.assert_allclose(small[1], cv2.resize(ratio[1], (8, 8), interpolation=cv2.INTER_AREA))


@pytest.mark.parametrize("workers", [1, 2, 3])
def test_block_means_are_the_means(workers: int) -> None:
    raw = np.random.default_rng(2).integers(0, 255, (50, 66, 3)).astype(np.uint8)
    means = np.empty((10, 13, 3), np.float32)
    flat = raw.reshape(50, -1)
    RowWorkers(workers).run(10, block_means, flat, np.float32(1 / 255), 5, means)
    plain = raw[:50, :65].reshape(10, 5, 13, 5, 3).mean(axis=(1, 3)) / 255
    np.testing.assert_allclose(means, plain, rtol=1e-5)
