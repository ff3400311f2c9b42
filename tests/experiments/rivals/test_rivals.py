"""The rivals learn what they can learn: each has its own exact case, and its known limits."""

from __future__ import annotations

from functools import partial
from itertools import pairwise

import numpy as np
import pytest

from gelpolight_core.errors import InputError
from gelpolight_core.experiments.rivals import network
from gelpolight_core.experiments.rivals.directional_table import fit_table
from gelpolight_core.experiments.rivals.network import fit_network
from gelpolight_core.experiments.rivals.polynomial import fit_polynomial
from gelpolight_core.experiments.rivals.samples import (
    BallSamples,
    read_samples,
    relative_change,
    write_samples,
)

FITS = {
    "table": fit_table,
    "polynomial": fit_polynomial,
    "network": partial(fit_network, steps=2000),
}


LEDS_MM = np.array([[12.0 * np.cos(a), 12.0 * np.sin(a), 9.0] for a in (0.3, 2.4, 4.5)])


def shaded(place: np.ndarray, slopes: np.ndarray, *, near: bool) -> np.ndarray:
    """Return I / I0 - 1 of a Lambertian surface, from the formula."""
    normal = np.concatenate([-slopes, np.ones((len(slopes), 1))], axis=1)
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    at = np.concatenate([place if near else 0.0 * place, np.zeros((len(place), 1))], axis=1)
    to = LEDS_MM - at[:, None]
    towards = to / np.linalg.norm(to, axis=2, keepdims=True)
    light = np.maximum((normal[:, None] * towards).sum(axis=2), 0.0)
    return light / towards[..., 2] - 1.0


def balls(count: int, seed: int, *, near: bool) -> BallSamples:
    """Return pixels of balls of 4 mm at random places."""
    rng = np.random.default_rng(seed)
    radius, angle = 2.3 * np.sqrt(rng.random((count, 300))), rng.uniform(0, 2 * np.pi, (count, 300))
    away = np.stack([radius * np.cos(angle), radius * np.sin(angle)], axis=-1)
    place = (rng.uniform(-7.0, 7.0, (count, 1, 2)) + away).reshape(-1, 2)
    away = away.reshape(-1, 2)
    slopes = -away / np.sqrt(16.0 - (away**2).sum(axis=1))[:, None]
    change = shaded(place, slopes, near=near) + rng.normal(0.0, 0.005, (len(place), 3))
    number = np.repeat(np.arange(count), 300).astype(np.int16)
    return BallSamples(*(a.astype(np.float32) for a in (change, place, slopes)), number)


@pytest.fixture(scope="module")
def errors() -> dict[tuple[str, str], float]:
    """Return the error of the slope in contacts that no rival has seen, over the slope's size."""
    found = {}
    for light in ("parallel", "near"):
        seen, others = (balls(n, n, near=light == "near") for n in (40, 5))
        size = np.median(np.hypot(*others.slopes.T))
        for name, fit in FITS.items():
            away = np.hypot(*(fit(seen)(others.change, others.position_mm) - others.slopes).T)
            found[light, name] = float(np.median(away) / size)
    return found


@pytest.mark.parametrize("name", list(FITS))
def test_under_parallel_even_light_every_rival_reads_slopes(
    errors: dict[tuple[str, str], float], name: str
) -> None:
    assert errors["parallel", name] < 0.15


def test_near_light_needs_the_position(errors: dict[tuple[str, str], float]) -> None:
    assert errors["near", "table"] > 2.0 * errors["parallel", "table"]
    assert errors["near", "network"] < errors["near", "table"]
    assert errors["near", "polynomial"] < 0.7 * errors["near", "table"]


def exact(slopes_of, seed: int = 0, count: int = 3000) -> BallSamples:  # type: ignore[no-untyped-def]
    rng = np.random.default_rng(seed)
    change = rng.uniform(-0.5, 0.5, (count, 3)).astype(np.float32)
    place = rng.uniform(-8.0, 8.0, (count, 2)).astype(np.float32)
    ball = (np.arange(count) % 5).astype(np.int16)
    return BallSamples(change, place, slopes_of(change, place).astype(np.float32), ball)


def cubic(change: np.ndarray, place: np.ndarray) -> np.ndarray:
    first = 0.7 * change[:, 0] - 0.2 * change[:, 1] * change[:, 2] + 0.01 * place[:, 0]
    return np.stack([first, change[:, 1] ** 2 - 0.002 * place[:, 0] * place[:, 1]], axis=1)


def test_the_polynomial_finds_a_polynomial_and_does_not_run_away_outside() -> None:
    samples, others = exact(cubic), exact(cubic, seed=1)
    predict = fit_polynomial(samples)
    assert np.abs(predict(others.change, others.position_mm) - others.slopes).max() < 1e-3
    far = predict(100.0 * others.change, others.position_mm)
    assert np.abs(far).max() < 10.0


def test_the_network_learns_a_smooth_function_and_repeats_itself() -> None:
    samples, others = exact(cubic, count=12_000), exact(cubic, seed=1)
    predict = fit_network(samples, steps=1200)
    found = predict(others.change, others.position_mm)
    spread = others.slopes.std()
    assert np.sqrt(np.mean((found - others.slopes) ** 2)) < 0.12 * spread
    one, two = (fit_network(samples, steps=20)(others.change, others.position_mm) for _ in (0, 1))
    assert np.array_equal(one, two)


def test_the_gradients_of_the_network_are_differences_of_its_error() -> None:
    rng = np.random.default_rng(3)
    sizes = (5, 4, 3, 2)
    layers = [(rng.standard_normal((a, b)), rng.standard_normal(b)) for a, b in pairwise(sizes)]
    inputs, wanted = rng.standard_normal((7, 5)), rng.standard_normal((7, 2))

    def error() -> float:
        return float(((network._values(layers, inputs)[-1] - wanted) ** 2).sum() / len(inputs))

    found = network._gradients(layers, inputs, wanted)
    for parameter, gradient in zip([p for layer in layers for p in layer], found, strict=True):
        at = (0,) * parameter.ndim
        parameter[at] += 1e-6
        high = error()
        parameter[at] -= 2e-6
        low = error()
        parameter[at] += 1e-6
        assert gradient[at] == pytest.approx((high - low) / 2e-6, rel=1e-4, abs=1e-6)


def test_samples_are_read_as_they_were_written(tmp_path) -> None:  # type: ignore[no-untyped-def]
    samples = exact(cubic, count=20)
    write_samples(samples, tmp_path / "balls.npz")
    back = read_samples(tmp_path / "balls.npz")
    assert np.array_equal(back.slopes, samples.slopes) and np.array_equal(back.ball, samples.ball)


@pytest.mark.parametrize("name", list(FITS))
def test_balls_that_show_nothing_are_refused(name: str) -> None:
    nothing = exact(lambda change, _: np.zeros((len(change), 2)), count=300)
    with pytest.raises(InputError, match="0 pixels"):
        FITS[name](nothing)


def test_where_the_background_is_dark_there_is_no_ratio() -> None:
    light = np.array([[0.2, 0.4, 0.5]], np.float32)
    background = np.array([[0.1, 0.4, 0.001]], np.float32)
    assert relative_change(light, background) == pytest.approx(np.array([[1.0, 0.0, 0.0]]))
