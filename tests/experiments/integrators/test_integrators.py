"""Integrators on surfaces with an exact formula."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from gelpolight_core.experiments.integrators.measure import (
    IntegratorPoint,
    integrator_order,
    measure_integrators,
)
from gelpolight_core.experiments.integrators.others import (
    cosine_transform,
    frankot_chellappa,
    shifted_cosine_transform,
    sparse_quadratic,
)
from gelpolight_core.experiments.integrators.surfaces import SURFACES, surface
from gelpolight_core.experiments.orders import fit_order
from gelpolight_core.reconstruction.integration.bilateral import integrate_bilateral

STEEP = ("wedge", "dome", "half_wall")
"""Surfaces with walls that no slope shows."""


@cache
def points() -> tuple[IntegratorPoint, ...]:
    return measure_integrators(sides=(40, 80), side=120, repeats=1)


def error(name: str, scene: str, key: str = "mean_um") -> float:
    found = [p for p in points() if (p.name, p.scene, p.side) == (name, scene, 120)]
    return float(getattr(found[0], key))


@pytest.mark.parametrize("name", [n for n in SURFACES if n not in (*STEEP, "holes", "noise")])
def test_slopes_of_the_surfaces_are_differences_of_their_depth(name: str) -> None:
    made = surface(name, 400)
    down, across = np.gradient(made.depth_mm, made.pitch_mm)
    inner = np.s_[2:-2, 2:-2]
    assert np.abs(across - made.slope_x)[inner].max() < 0.15
    assert np.median(np.abs(across - made.slope_x)[inner]) < 1e-3
    assert np.median(np.abs(down - made.slope_y)[inner]) < 1e-3


@pytest.mark.parametrize(
    ("name", "order"),
    [("sine_1", 1.0), ("sine_2", 2.0), ("sine_4", 4.0), ("weighted", 4.0), ("cosine", 2.0)],
)
def test_integrators_converge_as_their_stencils_say(name: str, order: float) -> None:
    found = integrator_order(points(), name)
    assert found is not None and found.value == pytest.approx(order, abs=0.15)


def test_the_sparse_and_the_cosine_solution_are_the_same_least_squares() -> None:
    made = surface("free_form", 60)
    args = made.slope_x, made.slope_y, made.pitch_mm
    difference = cosine_transform(*args) - sparse_quadratic(*args)
    assert np.ptp(difference) < 1e-6


def test_frankot_chellappa_is_exact_for_a_periodic_wave() -> None:
    x = np.arange(64) * 0.1
    k = 2.0 * np.pi / 6.4
    slope = np.tile(k * np.cos(k * x), (64, 1))
    found = frankot_chellappa(slope, np.zeros_like(slope), 0.1)
    assert found[5] == pytest.approx(np.sin(k * x), abs=1e-9)


def test_wrong_eigenvalues_give_heights_that_depend_on_the_width() -> None:
    heights = []
    axis = (np.arange(160) - 79.5) * 0.1
    x, y = np.meshgrid(axis, axis)
    for width in (1.0, 9.0):
        depth = np.exp(-(x**2 + y**2) / width)
        slopes = -2.0 * x / width * depth, -2.0 * y / width * depth
        heights.append(np.ptp(shifted_cosine_transform(*slopes, 0.1)))
        assert np.ptp(cosine_transform(*slopes, 0.1)) == pytest.approx(1.0, abs=0.01)
    assert heights[0] > 1.2 and heights[0] > 1.3 * heights[1]


def test_ours_is_never_worse_than_the_best_where_slopes_are_lost_or_cut() -> None:
    for scene in ("holes", "noise"):
        others = [error(name, scene) for name in ("cosine", "fourier", "sparse")]
        assert error("weighted", scene) < 1.05 * min(others)
    assert error("weighted", "cut") < 0.2 < error("fourier", "cut")


def test_bilateral_halves_the_median_at_upright_walls() -> None:
    for scene in ("wedge", "half_wall"):
        rest = [error(n, scene, "middle_um") for n in ("weighted", "cosine", "fourier", "sparse")]
        assert error("bilateral", scene, "middle_um") < 0.5 * min(rest)


@pytest.mark.parametrize("scene", ["bump", "free_form", "holes"])
def test_bilateral_costs_next_to_nothing_on_smooth_surfaces(scene: str) -> None:
    assert error("bilateral", scene) < 2.0


def test_bilateral_without_preference_is_least_squares() -> None:
    made = surface("free_form", 60)
    found = integrate_bilateral(
        made.slope_x, made.slope_y, pitch_mm=made.pitch_mm, steepness=0.0
    ).depth_mm
    least_squares = cosine_transform(made.slope_x, made.slope_y, made.pitch_mm)
    # The normals' equation trusts steep slopes less.
    assert np.ptp(found - least_squares) < 5e-3


def test_bilateral_leaves_out_what_is_not_valid() -> None:
    made = surface("bump", 80)
    slope_x = made.slope_x.copy()
    slope_x[30:34, 30:34] = np.nan
    found = integrate_bilateral(slope_x, made.slope_y, pitch_mm=made.pitch_mm)
    assert np.isnan(found.depth_mm[31, 31]) and found.converged
    assert np.nanmedian(np.abs(found.depth_mm - made.depth_mm)) < 1e-3
    with pytest.raises(ValueError, match="0 of them valid"):
        integrate_bilateral(slope_x, made.slope_y, pitch_mm=0.1, valid=np.zeros((80, 80), bool))


def test_an_order_has_an_interval_and_states_a_limit_only_where_it_is_narrow() -> None:
    pitch = (0.1, 0.05, 0.02, 0.01)
    exact = fit_order(pitch, [3.0 * p**2 for p in pitch])
    assert exact is not None
    assert exact.value == pytest.approx(2.0) and exact.half_width < 1e-6
    assert exact.limit == "the pixel size"
    flat = fit_order(pitch, [5.0, 5.01, 4.99, 5.0])
    assert flat is not None and flat.limit == "not the pixel size"
    uneven = fit_order(pitch[:3], [5.0, 1.0, 4.0])
    assert uneven is not None and uneven.limit == "" and uneven.half_width > 1.0
    assert fit_order(pitch[:2], [2.0, 1.0]) is None
