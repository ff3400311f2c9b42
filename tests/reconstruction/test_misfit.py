"""How well a surface explains its image."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gelpolight_core.reconstruction.misfit import solve_misfit
from gelpolight_core.reconstruction.reconstructor import Reconstructor
from gelpolight_core.sensor_calibration import Calibration
from gelpolight_core.session.images import read_image


@pytest.fixture(scope="module")
def press(small_session: Path) -> np.ndarray:
    return read_image(small_session / "balls" / "ball_00.png").rgb


def test_the_papers_misfit_is_the_length_of_its_normal_less_one(
    small_calibration: Calibration, press: np.ndarray
) -> None:
    reconstruct = Reconstructor(small_calibration, model="paper")
    heightmap = reconstruct.depth(press)
    misfit = solve_misfit(reconstruct, press, heightmap, largest=10_000)
    known = np.isfinite(misfit.values)
    length_error = reconstruct.slopes(press).length_error
    assert misfit.model == "paper"
    np.testing.assert_array_equal(misfit.values[known], length_error[known])
    np.testing.assert_array_equal(known, heightmap.flags & 1 == 0)


def test_a_true_surface_explains_its_image_and_a_false_one_does_not(
    small_calibration: Calibration, press: np.ndarray
) -> None:
    reconstruct = Reconstructor(small_calibration, effort="best")
    heightmap = reconstruct.depth(press)
    true = solve_misfit(reconstruct, press, heightmap, largest=10_000)
    assert true.model == "full"
    assert np.nanmedian(true.values) < 0.02
    assert heightmap.normals is not None
    flat = np.zeros_like(heightmap.normals)
    flat[..., 2] = -1.0
    lying = replace(heightmap, normals=flat)
    false = solve_misfit(reconstruct, press, lying, largest=10_000)
    pressed = heightmap.depth_mm > 0.3 * heightmap.depth_mm.max()
    assert np.nanmean(false.values[pressed]) > 4.0 * np.nanmean(true.values[pressed])
