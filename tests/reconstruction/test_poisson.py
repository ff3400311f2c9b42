"""What a user relies on when slopes are turned into depth."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from gelpolight_core.reconstruction.integration.poisson import PoissonSolver
from tests.slopes import exact_depth, integrate_slopes, smooth_bump

SIZES = st.integers(min_value=2, max_value=43)


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


def test_error_falls_with_the_fourth_power_of_the_pitch():
    errors = []
    # Finer grids would show the rounding of single precision.
    for size in (40, 60, 90):
        depth, slope_x, slope_y = uneven_scene(size, size, 10.0 / size)
        found_mm = integrate_slopes(slope_x, slope_y, pitch_mm=10.0 / size)
        errors.append(np.abs(found_mm - depth).max())
    orders = np.log(np.divide(errors[:-1], errors[1:])) / np.log(1.5)
    assert orders == pytest.approx(4.0, abs=0.3)


@given(SIZES, SIZES, st.integers(0, 2**32 - 1), st.floats(0.005, 2.0))
@example(2, 2, 0, 1.0)
@example(2, 37, 1, 0.1)
@example(41, 3, 1, 0.1)
@example(31, 43, 2, 0.02)
@settings(deadline=None, max_examples=150)
def test_depth_whose_slopes_are_polynomials_comes_back_exactly(rows, columns, seed, pitch_mm):
    # The depth is 0 on the outline of the pixels; its slopes are cubic (lower on a grid too small
    # for four slopes), which the stencil integrates without error, at the border and the padding
    # too: what is left is rounding.
    generator = np.random.default_rng(seed)

    def profile(size: int):
        free = generator.uniform(-1, 1, min(size, 4) - 1)
        outline = np.polynomial.Polynomial([0, 1, -1])
        curve = outline * np.polynomial.Polynomial(free)
        place = (np.arange(size) + 0.5) / size
        return curve(place), curve.deriv()(place) / (size * pitch_mm)

    along_y, slope_along_y = profile(rows)
    along_x, slope_along_x = profile(columns)
    slopes = np.outer(along_y, slope_along_x), np.outer(slope_along_y, along_x)
    found_mm = integrate_slopes(*slopes, pitch_mm=pitch_mm)
    assert found_mm.shape == (rows, columns)
    # Rounding of single precision, on slopes of at most 2 times the longer side.
    assert found_mm == pytest.approx(np.outer(along_y, along_x), abs=2e-6)


@pytest.mark.parametrize(
    ("rows", "columns", "share"),
    [
        (2, 2, math.inf),  # too few nodes for a bump
        (3, 5, math.inf),
        (16, 8192, 0.1),
        (8192, 16, 0.1),
        (4, 65_536, 0.1),  # on a few nodes it is not smooth
        (127, 131, 1e-4),
        (1279, 957, 1e-4),
    ],
)
def test_a_bump_comes_back_on_a_grid_of_any_size(rows, columns, share):
    depth, slope_x, slope_y, pitch_mm = smooth_bump(rows, columns)
    error_mm = integrate_slopes(slope_x, slope_y, pitch_mm=pitch_mm) - depth
    assert np.isfinite(error_mm).all()
    assert np.sqrt(np.mean(error_mm.astype(np.float64) ** 2)) < share * depth.max()


@pytest.mark.parametrize(("rows", "columns"), [(240, 320), (960, 1280)])
def test_single_precision_and_elimination_cost_less_than_a_twentieth_of_a_micrometre(rows, columns):
    """Against two transforms in double precision, on a bump of about 1 mm."""
    _, slope_x, slope_y, pitch_mm = smooth_bump(rows, columns)
    found_mm = integrate_slopes(slope_x, slope_y, pitch_mm=pitch_mm)
    expected_mm = exact_depth(slope_x, slope_y, pitch_mm)
    assert np.abs(found_mm - expected_mm).max() < 5e-5


def test_slopes_that_are_hardly_numbers_leave_the_membrane_flat():
    slope = np.full((64, 64), 1e-42, np.float32)
    assert np.abs(integrate_slopes(slope, slope, pitch_mm=0.1)).max() < 1e-30


@pytest.mark.parametrize(
    "wrong", [{"rows": 0}, {"columns": -1}, {"pitch_mm": 0.0}, {"pitch_mm": np.nan}]
)
def test_a_solver_that_cannot_be_is_refused(wrong):
    good: dict[str, object] = {"rows": 4, "columns": 5, "pitch_mm": 0.1}
    options = good | wrong
    with pytest.raises(ValueError, match=r"\d"):
        PoissonSolver(options.pop("rows"), options.pop("columns"), **options)
