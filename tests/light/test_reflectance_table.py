"""The reflectance table: monotone, robust, honest about what it has not seen."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from gelpolight_core.base.errors import InputError
from gelpolight_core.light.reflectance_table import ReflectanceTable, fit_channel

RNG = np.random.default_rng(0)


def fitted(cosines: np.ndarray, values: np.ndarray) -> ReflectanceTable:
    """Return a table with one fit in all three channels."""
    fit = fit_channel(cosines, values, name="red")
    return ReflectanceTable((fit.cosines,) * 3, (fit.values,) * 3, np.tile(fit.coverage, (3, 1)))


@settings(max_examples=25, deadline=None)
@given(st.floats(0.6, 1.8), st.floats(0.2, 2.0), st.floats(0.0, 0.05))
def test_a_power_law_is_recovered_through_noise_and_outliers(exponent, gain, noise):
    rng = np.random.default_rng(5)
    cosines = rng.uniform(0.2, 0.97, 20_000)
    values = gain * cosines**exponent * (1.0 + noise * rng.normal(size=cosines.size))
    values[:400] *= 2.5
    table = fitted(cosines, values)
    seen = np.linspace(0.25, 0.92, 50)
    np.testing.assert_allclose(table.response(0, seen), gain * seen**exponent, rtol=0.02)
    np.testing.assert_allclose(table.cosine(0, gain * seen**exponent), seen, atol=0.02)


def test_the_table_and_its_inverse_undo_each_other_and_grow():
    cosines = RNG.uniform(0.3, 0.9, 5_000)
    table = fitted(cosines, cosines**1.3)
    every = np.linspace(0.0, 1.0, 501)
    response = table.response(1, every)
    assert (np.diff(response) > 0).all()
    inside = every[(every > 0.32) & (every < 0.88)]
    np.testing.assert_allclose(table.cosine(1, table.response(1, inside)), inside, atol=2e-3)


def test_what_the_balls_have_shown_is_stated():
    cosines = RNG.uniform(0.4, 0.8, 5_000)
    coverage = fitted(cosines, cosines).coverage[0]
    np.testing.assert_allclose(coverage, [0.4, 0.8], atol=0.02)


def test_stray_light_is_what_a_shadow_shows():
    """With light that no angle takes away, a value at its level means no direct light at all."""
    cosines = RNG.uniform(0.15, 0.95, 20_000)
    table = fitted(cosines, 0.1 + 0.9 * cosines)
    assert table.cosine(0, np.array(0.1)) == pytest.approx(0.0, abs=0.01)
    assert table.cosine(0, np.array(0.02)) == 0.0


def test_the_fast_table_is_the_table():
    cosines = RNG.uniform(0.2, 0.95, 20_000)
    table = fitted(cosines, np.sqrt(cosines))
    lookup, scale = table.lookup()
    value = 0.7
    place = value * scale[0]
    fast = np.interp(place, np.arange(2048), lookup[0])
    assert fast == pytest.approx(float(table.cosine(0, np.array(value))), abs=1e-4)


@pytest.mark.parametrize(
    ("cosines", "values", "what"),
    [
        (RNG.uniform(0.2, 0.9, 50), RNG.uniform(0.2, 0.9, 50), "usable pixels"),
        (RNG.uniform(0.2, 0.9, 5000), RNG.uniform(0.4, 0.41, 5000), "does not become brighter"),
        (np.full(5000, np.nan), np.ones(5000), "usable pixels"),
    ],
)
def test_a_scatter_without_a_curve_is_refused(cosines, values, what):
    with pytest.raises(InputError, match=what):
        fit_channel(cosines, values, name="red")
