"""Contacts that are stretched towards the edge show a wrong correction of refraction."""

from types import SimpleNamespace

import numpy as np
import pytest

from gelpolight_core.base.finding import Finding, Verdict
from gelpolight_core.geometry.membrane_shape import FLAT, MembraneShape
from gelpolight_core.geometry.resampling import MembraneGrid
from gelpolight_core.stages.balls.press_agreement import judge_roundness

PLACES = [(0, 0), (60, 10), (-90, 70), (120, -60), (-20, -150), (150, 40)]


def judged(*, stretch: float) -> Finding:
    """Judge noisy contacts that are stretched at the edge."""
    random, turns = np.random.default_rng(1), np.linspace(0.0, 2.0 * np.pi, 90, endpoint=False)
    presses, x = [], np.arange(401.0) - 200.0
    for place in np.array(PLACES, float):
        away = np.hypot(*place)
        circle = 25.0 * np.stack([np.cos(turns), np.sin(turns)], axis=-1)
        circle += random.normal(0.0, 0.2, circle.shape)
        along = place / max(away, 1e-9)
        contour = circle + stretch * (away / 155.0) ** 2 * np.outer(circle @ along, along)
        presses.append(SimpleNamespace(indentation=SimpleNamespace(contour=contour + place + 200)))
    table = SimpleNamespace(grid=MembraneGrid(x, x, 1.0), surface=FLAT)
    dome = SimpleNamespace(grid=table.grid, surface=MembraneShape("spherical_cap", 40.0, 400.0))
    assert judge_roundness(presses, dome) == ()
    (figure,) = judge_roundness(presses, table)
    return figure


def test_round_contacts_pass():
    assert judged(stretch=0.0).verdict is Verdict.PASS


@pytest.mark.parametrize("stretch", [0.03, -0.03])
def test_contacts_that_are_stretched_towards_the_edge_are_found(stretch):
    figure = judged(stretch=stretch)
    assert figure.verdict is Verdict.WARN
    assert figure.value == pytest.approx(3.0, abs=0.5)


def test_few_presses_are_not_judged():
    assert judge_roundness([], SimpleNamespace(grid=MembraneGrid(*[np.arange(3.0)] * 2, 1.0))) == ()
