"""What a user relies on when slopes are turned into depth."""

from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from gelpolight_core.reconstruction.integration.poisson import (
    SLOPE_LIMIT,
    IntegrationResult,
    PoissonSolver,
)


def integrate_slopes(slope_x: np.ndarray, slope_y: np.ndarray, **options: Any) -> IntegrationResult:
    solver = PoissonSolver(*slope_x.shape, dtype=slope_x.dtype, **options)
    return solver.integrate(slope_x, slope_y)


SIZES = st.integers(min_value=1, max_value=43)


def uneven_scene(rows: int, columns: int, pitch_mm: float):
    """Three different Gaussian dents, none of them on a symmetry of the grid."""
    x = (np.arange(columns) - columns / 2) * pitch_mm
    y = (np.arange(rows) - rows / 2) * pitch_mm
    y, x = np.meshgrid(y, x, indexing="ij")
    width = columns * pitch_mm
    depth, slope_x, slope_y = np.zeros_like(x), np.zeros_like(x), np.zeros_like(x)
    for u, v, sx, sy, height in (
        (-0.13, 0.05, 0.035, 0.045, 1.0),
        (0.11, -0.07, 0.05, 0.03, 0.6),
        (0.04, 0.11, 0.03, 0.03, -0.3),
    ):
        dx, dy = x - u * width, y - v * width
        dent = height * np.exp(-((dx / (sx * width)) ** 2 + (dy / (sy * width)) ** 2) / 2)
        depth += dent
        slope_x -= dx / (sx * width) ** 2 * dent
        slope_y -= dy / (sy * width) ** 2 * dent
    return depth, slope_x, slope_y


@pytest.mark.parametrize("stencil", [4, 2, 1])
def test_error_falls_with_the_pitch_as_the_stencil_promises(stencil):
    errors = []
    for size in (60, 120, 240):
        depth, slope_x, slope_y = uneven_scene(size, size, 10.0 / size)
        found = integrate_slopes(slope_x, slope_y, pitch_mm=10.0 / size, stencil=stencil)
        errors.append(np.abs(found.depth_mm - depth).max())
    orders = np.log2(np.divide(errors[:-1], errors[1:]))
    assert orders == pytest.approx(stencil, abs=0.25)


@given(SIZES, SIZES, st.integers(0, 2**32 - 1), st.floats(0.005, 2.0))
@example(1, 1, 0, 1.0)
@example(2, 2, 0, 1.0)
@example(1, 37, 1, 0.1)
@example(41, 1, 1, 0.1)
@example(31, 43, 2, 0.02)
@settings(deadline=None, max_examples=150)
def test_depth_whose_slopes_are_polynomials_comes_back_exactly(rows, columns, seed, pitch_mm):
    # The depth is 0 on the outline of the pixels; its slopes are cubic (lower on a grid too small
    # for four slopes), which the stencil integrates without error, at the border and the padding
    # too: what is left is rounding.
    generator = np.random.default_rng(seed)

    def profile(size: int):
        if size == 1:
            return np.ones(1), np.zeros(1)
        free = generator.uniform(-1, 1, min(size, 4) - 1)
        outline = np.polynomial.Polynomial([0, 1, -1])
        curve = outline * np.polynomial.Polynomial(free)
        place = (np.arange(size) + 0.5) / size
        return curve(place), curve.deriv()(place) / (size * pitch_mm)

    along_y, slope_along_y = profile(rows)
    along_x, slope_along_x = profile(columns)
    depth = np.outer(along_y, along_x) if rows * columns > 1 else np.zeros((1, 1))
    solver = PoissonSolver(
        rows, columns, pitch_mm=pitch_mm, dtype=np.float64, slope_limit=1e6, workers=1
    )
    found = solver.integrate(np.outer(along_y, slope_along_x), np.outer(slope_along_y, along_x))
    assert found.depth_mm.shape == (rows, columns)
    assert found.depth_mm == pytest.approx(depth, abs=1e-12)


@pytest.mark.parametrize("fault", [np.nan, np.inf, -np.inf])
def test_a_fault_in_one_pixel_leaves_the_rest_of_the_map(fault):
    depth, slope_x, slope_y = uneven_scene(120, 160, 0.1)
    broken_x, broken_y = slope_x.copy(), slope_y.copy()
    broken_x[50, 60] = broken_y[50, 60] = broken_y[0, 159] = fault
    found = integrate_slopes(broken_x, broken_y, pitch_mm=0.1)
    assert (found.sanitised_count, found.clipped_count) == (3, 0)
    far = np.hypot(*(np.indices(depth.shape) - np.array([50, 60])[:, None, None])) > 10
    # A missing slope s acts as a dipole: s h^2 / (2 pi r) = 2 % of a pixel's step at 10 px.
    limit = 2 * np.abs([slope_x[50, 60], slope_y[50, 60]]).max() * 0.1 / (2 * np.pi * 10)
    good = integrate_slopes(slope_x, slope_y, pitch_mm=0.1).depth_mm
    assert np.isfinite(found.depth_mm).all()
    assert np.abs(found.depth_mm - good)[far].max() < limit


@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_an_absurd_slope_is_clipped_and_counted(dtype):
    slope_x, slope_y = np.zeros((2, 90, 120), dtype=dtype)
    slope_x[40, 50], slope_y[41, 50] = 1e4, -1e4
    found = integrate_slopes(slope_x, slope_y, pitch_mm=0.02)
    assert (found.sanitised_count, found.clipped_count) == (0, 2)
    slope_x[40, 50], slope_y[41, 50] = SLOPE_LIMIT, -SLOPE_LIMIT
    at_limit = integrate_slopes(slope_x, slope_y, pitch_mm=0.02)
    assert at_limit.clipped_count == 0
    assert np.array_equal(found.depth_mm, at_limit.depth_mm)
    assert np.abs(found.depth_mm).max() < 2 * SLOPE_LIMIT * 0.02


@pytest.mark.parametrize(
    "wrong",
    [
        {"rows": 0},
        {"columns": -1},
        {"pitch_mm": 0.0},
        {"pitch_mm": np.nan},
        {"dtype": np.int32},
        {"stencil": 3},
        {"slope_limit": 0.0},
    ],
)
def test_a_solver_that_cannot_be_is_refused(wrong):
    good: dict[str, object] = {"rows": 4, "columns": 5, "pitch_mm": 0.1}
    options = good | wrong
    with pytest.raises(ValueError, match=r"\d"):
        PoissonSolver(options.pop("rows"), options.pop("columns"), **options)
