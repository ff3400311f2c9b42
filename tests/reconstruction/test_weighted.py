"""Weighted integration: the plain solution for even weights, and deaf to what is not trusted."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from gelpolight_core.reconstruction.integration.weighted import TOLERANCE, integrate_weighted
from tests.slopes import integrate_slopes, smooth_bump

Array = NDArray[np.float64]
PITCH = 0.05
ROWS, COLUMNS = 160, 200
X = PITCH * (np.arange(COLUMNS) - 90.0)
Y = PITCH * (np.arange(ROWS) - 70.0)
XX, YY = np.meshgrid(X, Y)


def single(*arrays: Array) -> tuple[NDArray[np.float32], ...]:
    return tuple(np.asarray(a, np.float32) for a in arrays)


def lopsided() -> tuple[Array, Array, Array]:
    """Return depth and slopes of a bump that no swap or flip leaves alone, flat at the border."""
    u, v = XX - 0.6, YY + 0.4
    bump = np.exp(-(u**2) / 1.5 - v**2 / 0.7)
    share = 1.0 + 0.3 * u
    return bump * share, bump * (0.3 - 2.0 * u / 1.5 * share), -2.0 * v / 0.7 * bump * share


def plateau(edge_mm: float = 0.35) -> tuple[Array, Array, Array, Array]:
    """Return depth, slopes and radius of a plateau 1 mm deep with a wall, off the middle."""
    u, v = XX - 0.5, (YY + 0.3) * 1.25
    r = np.hypot(u, v)
    share = np.clip((r - 1.8) / edge_mm, 0.0, 1.0)
    depth = 0.5 * (1.0 + np.cos(np.pi * share))
    fall = np.where(
        (share > 0.0) & (share < 1.0), -0.5 * np.pi / edge_mm * np.sin(np.pi * share), 0
    )
    safe = np.maximum(r, 1e-9)
    return depth, fall * u / safe, fall * v / safe * 1.25, r


def test_a_known_surface_comes_back():
    depth, slope_x, slope_y = lopsided()
    found = integrate_weighted(*single(slope_x, slope_y, np.ones_like(depth)), pitch_mm=PITCH)
    assert found.converged
    # Fourth order: the stencil's error is below 1 um here, the rest is single precision.
    assert np.abs(found.depth_mm - depth).max() < 2e-3
    assert found.depth_mm.dtype == np.float32


@settings(max_examples=12, deadline=None)
@given(st.integers(0, 999), st.floats(0.02, 0.2))
def test_even_weights_are_the_plain_integration_also_of_noise(seed, noise):
    """Noise is not integrable: both must strike the same balance, not only find what fits."""
    random = np.random.default_rng(seed)
    _, slope_x, slope_y = lopsided()
    noisy = [s + noise * random.normal(size=s.shape) for s in (slope_x, slope_y)]
    for s in noisy:  # next to the border the two have different edge integrals
        s[:5] = s[-5:] = s[:, :5] = s[:, -5:] = 0.0
    maps = single(*noisy, np.ones_like(slope_x))
    expected = integrate_slopes(maps[0], maps[1], pitch_mm=PITCH)
    found = integrate_weighted(*maps, pitch_mm=PITCH)
    assert found.rounds <= 1
    assert found.converged
    assert np.abs(found.depth_mm - expected).max() < 1e-5


@pytest.mark.parametrize("sector_deg", [60.0, 150.0, 300.0])
def test_wrong_slopes_that_are_not_trusted_leave_the_plateau_at_its_height(sector_deg):
    """A wall in shadow: on part of the ring the slopes are nonsense and weighted down."""
    depth, slope_x, slope_y, r = plateau()
    angle = np.degrees(np.arctan2(YY + 0.3, XX - 0.5)) % 360.0
    shadow = (r > 1.75) & (r < 2.2) & (angle < sector_deg)
    slope_x, slope_y = np.where(shadow, 0.0, slope_x), np.where(shadow, 0.0, slope_y)
    top = r < 1.6
    trusting = integrate_weighted(*single(slope_x, slope_y, np.ones_like(depth)), pitch_mm=PITCH)
    assert abs(np.median(trusting.depth_mm[top]) - 1.0) > 0.05  # the wrong slopes do matter
    weight = np.where(shadow, 1e-4, 1.0)
    found = integrate_weighted(*single(slope_x, slope_y, weight), pitch_mm=PITCH)
    # Nothing but the wall that is left decides; it carries at least a sixth of the ring, and the
    # untrusted part pulls by 1e-4 of its share.
    assert found.converged
    assert np.median(found.depth_mm[top]) == pytest.approx(1.0, abs=0.01)
    assert np.abs(found.depth_mm[top] - 1.0).max() < 0.03


def test_the_least_squares_balance_is_the_dense_one():
    """On a small grid against numpy's least squares with the same edges and border."""
    random = np.random.default_rng(5)
    rows, columns, pitch = 7, 9, 0.3
    slope_x, slope_y = random.normal(size=(2, rows, columns))
    weight = random.uniform(0.05, 1.0, (rows, columns))

    def edges(slope: Array) -> Array:
        found = 0.5 * (slope[:, 1:] + slope[:, :-1])
        for j in range(1, slope.shape[1] - 2):
            taps = slope[:, j - 1 : j + 3] @ np.array([-1.0, 13.0, 13.0, -1.0])
            found[:, j] = taps / 24.0
        return pitch * found

    lines, right, scale = [], [], []
    at = np.arange(rows * columns).reshape(rows, columns)

    def ask(plus: int | None, minus: int | None, value: float, w: float) -> None:
        line = np.zeros(rows * columns)
        if plus is not None:
            line[plus] += 1.0
        if minus is not None:
            line[minus] -= 1.0
        lines.append(line)
        right.append(value)
        scale.append(np.sqrt(w))

    along, down = edges(slope_x), edges(slope_y.T).T
    for i in range(rows):
        for j in range(columns):
            if j + 1 < columns:
                least = min(weight[i, j], weight[i, j + 1])
                ask(at[i, j + 1], at[i, j], along[i, j], least)
            if i + 1 < rows:
                least = min(weight[i, j], weight[i + 1, j])
                ask(at[i + 1, j], at[i, j], down[i, j], least)
            # Depth 0 half a node outside: a spring of twice the stiffness.
            for border in (i == 0, i == rows - 1, j == 0, j == columns - 1):
                if border:
                    ask(at[i, j], None, 0.0, 2.0)
    weights = np.array(scale)
    expected = np.linalg.lstsq(
        np.array(lines) * weights[:, None], np.array(right) * weights, rcond=None
    )[0].reshape(rows, columns)
    found = integrate_weighted(*single(slope_x, slope_y, weight), pitch_mm=pitch, tolerance=1e-6)
    assert found.converged
    np.testing.assert_allclose(found.depth_mm, expected, atol=1e-5)


def test_rounds_that_do_not_suffice_are_reported():
    """A tolerance below single precision cannot be reached."""
    random = np.random.default_rng(2)
    slope_x, slope_y = random.normal(size=(2, ROWS, COLUMNS))
    weight = random.uniform(0.0, 1.0, (ROWS, COLUMNS)) ** 8
    found = integrate_weighted(*single(slope_x, slope_y, weight), pitch_mm=PITCH, tolerance=1e-12)
    assert not found.converged
    assert np.isfinite(found.depth_mm).all()


def walled() -> tuple[Array, Array, Array, float]:
    """Return a bump's slopes, wrong along a ring, with low weights there, and the pitch."""
    _, slope_x, slope_y, pitch_mm = smooth_bump(240, 320)
    y, x = np.mgrid[:240, :320]
    ring = np.abs(np.hypot(x - 160, y - 120) - 60.0) < 2.0
    slope_x[ring], slope_y[ring] = 0.0, 0.0
    return slope_x, slope_y, np.where(ring, 0.01, 1.0).astype(np.float32), pitch_mm


def test_the_usual_tolerance_is_within_two_micrometres_of_a_strict_one():
    *maps, pitch_mm = walled()
    usual, strict = (
        integrate_weighted(*maps, pitch_mm=pitch_mm, tolerance=t) for t in (TOLERANCE, 1e-6)
    )
    assert np.abs(usual.depth_mm - strict.depth_mm).max() < 2e-3


def test_slopes_of_which_none_counts_give_a_finite_depth():
    slope_x, slope_y, weight, pitch_mm = walled()
    found = integrate_weighted(slope_x, slope_y, np.zeros_like(weight), pitch_mm=pitch_mm)
    assert np.isfinite(found.depth_mm).all()
