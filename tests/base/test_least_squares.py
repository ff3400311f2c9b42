"""The fit against SciPy's, which reaches the same minimum by another method."""

import numpy as np
import pytest
from scipy.optimize import least_squares, minimize

from gelpolight_core.base.least_squares import fit_least_squares

TIME = np.linspace(0.0, 4.0, 400)
START = np.array([1.0, 0.5, 0.1])
FREE = (np.full(3, -np.inf), np.full(3, np.inf))


def decay(x: np.ndarray) -> np.ndarray:
    return x[0] * np.exp(-x[1] * TIME) + x[2]


def slopes(x: np.ndarray) -> np.ndarray:
    falling = np.exp(-x[1] * TIME)
    return np.stack([falling, -x[0] * TIME * falling, np.ones_like(TIME)], axis=1) / 0.02


def measured(outliers: int) -> np.ndarray:
    rng = np.random.default_rng(3)
    values = decay(np.array([2.0, 1.3, 0.5])) + 0.02 * rng.standard_normal(TIME.size)
    values[rng.choice(TIME.size, outliers, replace=False)] += 3.0
    return values


@pytest.mark.parametrize("scale", [None, np.ones(3)])
@pytest.mark.parametrize(("robust", "loss"), [(True, "soft_l1"), (False, "linear")])
@pytest.mark.parametrize("outliers", [0, 20])
@pytest.mark.parametrize(
    "bounds", [FREE, (np.array([-np.inf, 0.0, 0.0]), np.array([1.5, 3.0, np.inf]))]
)
def test_it_finds_the_minimum_that_scipy_finds(outliers, bounds, robust, loss, scale):
    values = measured(outliers)

    def residuals(x: np.ndarray) -> np.ndarray:
        return (decay(x) - values) / 0.02

    found = fit_least_squares(
        residuals, slopes, START, bounds, scale=scale, robust=robust, tolerance=1e-9
    )
    other = least_squares(
        residuals, START, slopes, bounds, loss=loss, xtol=1e-12, ftol=1e-12, gtol=1e-12
    )
    assert found.converged
    # A fiftieth of the least standard deviation that the noise leaves these parameters.
    assert found.x == pytest.approx(other.x, abs=1e-4)
    assert (bounds[0] <= found.x).all() and (found.x <= bounds[1]).all()


def test_outliers_hardly_move_the_robust_fit():
    def fitted(outliers: int) -> np.ndarray:
        values = measured(outliers)
        return fit_least_squares(
            lambda x: (decay(x) - values) / 0.02, slopes, START, FREE, robust=True
        ).x

    assert fitted(20) == pytest.approx(fitted(0), abs=0.01)


def test_residuals_that_are_not_robust_count_by_their_square():
    """What is known beforehand stays, however many outliers contradict it."""
    values, known = measured(40), np.array([2.0, 1.3, 0.5])
    sd = np.array([0.001, 0.5, 0.01])

    def residuals(x: np.ndarray) -> np.ndarray:
        return np.append((decay(x) - values) / 0.02, (x - known) / sd)

    def with_prior(x: np.ndarray) -> np.ndarray:
        return np.concatenate([slopes(x), np.diag(1.0 / sd)])

    def cost(x: np.ndarray) -> float:
        seen = residuals(x)
        soft, plain = seen[: TIME.size], seen[TIME.size :]
        return float(np.sum(np.sqrt(1.0 + soft**2) - 1.0) + 0.5 * np.sum(plain**2))

    robust = np.arange(TIME.size + 3) < TIME.size
    found = fit_least_squares(residuals, with_prior, START, FREE, robust=robust, tolerance=1e-9)
    other = minimize(cost, found.x, method="Nelder-Mead", options={"xatol": 1e-7, "fatol": 1e-9})
    assert found.x == pytest.approx(other.x, abs=1e-4)
    assert found.slopes is None
    for every in (True, False):
        mask = np.full(robust.size, every)
        same = [
            fit_least_squares(residuals, with_prior, START, FREE, robust=one).x
            for one in (mask, every)
        ]
        np.testing.assert_array_equal(*same)


@pytest.mark.parametrize("scaled", [False, True])
def test_parameters_of_any_unit_give_the_same_fit(scaled):
    values = measured(0)
    unit = np.array([1e-6, 1.0, 1e6])
    found = [
        fit_least_squares(
            lambda x, u=u: (decay(x * u) - values) / 0.02,
            lambda x, u=u: slopes(x * u) * u,
            START / u,
            FREE,
            scale=1.0 / u if scaled else None,
        ).x
        * u
        for u in (np.ones(3), unit)
    ]
    assert found[1] == pytest.approx(found[0], rel=1e-6)
