"""Stated standard deviations of sizes, over many edges, blurs and presses."""

import numpy as np
import pytest

from gelpolight_core.simulation.indenters import CuboidIndenter, CylinderIndenter
from tests.measurement.test_honest_sizes import MODES, departures, holds_size
from tests.measurement.test_object_measurement import scatter_is_stated

PRESSES = (
    CylinderIndenter(3.0, 0.5),
    CuboidIndenter(4.0, 1.0, 0.1),
    CuboidIndenter(5.0, 0.3, 0.1),
    CylinderIndenter(5.0, 1.5),
    CylinderIndenter(5.0, 1.0, 0.3),
    CuboidIndenter(5.0, 1.0, 0.5),
)


@pytest.mark.parametrize("edge_mm", [0.0, 0.08, 0.15, 0.3, 0.5])
@pytest.mark.parametrize("kind", [CylinderIndenter, CuboidIndenter])
def test_no_edge_makes_an_object_smaller_than_it_states(kind, edge_mm):
    for blur_mm in (0.015, 0.07):
        holds_size(kind, edge_mm, blur_mm)


@pytest.mark.parametrize("mode", MODES)
def test_deviations_are_neither_too_small_nor_an_empty_promise(mode):
    pairs = [p for n, press in enumerate(PRESSES) for p in departures(mode, press, n)]
    error, sd = np.array(pairs).T
    share = np.abs(error) / sd
    assert np.mean(share <= 3.0) >= 0.95 and share.max() < 5.0, share
    assert np.sqrt(np.mean(share**2)) > 1.0 / 3.0


def test_the_stated_sd_is_the_scatter_of_repeats_of_a_cuboid():
    scatter_is_stated("cuboid")
