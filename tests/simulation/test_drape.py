"""The pressed membrane compared with the closed solution of the elastic foundation."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.special import k0, k1

from gelpolight_core.simulation.drape import contact_radius, solve_drape
from gelpolight_core.simulation.indenters import (
    BallIndenter,
    CuboidIndenter,
    CylinderIndenter,
    ReliefIndenter,
    coin,
    nut,
    press_surface,
)


@given(st.floats(1.0, 8.0), st.floats(0.05, 0.4), st.floats(0.3, 2.0))
@settings(max_examples=40, deadline=None)
def test_ball_is_left_where_both_slopes_agree(radius, share, decay):
    ball = BallIndenter(radius, share * radius)
    b = contact_radius(ball.profile, ball.reach_mm, decay)
    depth = ball.depth_mm - radius + math.sqrt(radius**2 - b**2)
    slope = b / math.sqrt(radius**2 - b**2)
    assert 0.0 < b < ball.reach_mm
    assert slope == pytest.approx(depth * k1(b / decay) / k0(b / decay) / decay, rel=1e-6)


@pytest.mark.parametrize("radius, depth", [(3.0, 1.0), (4.0, 0.8)])
def test_grid_solution_over_a_ball_is_the_bessel_solution(radius, depth):
    ball, decay = BallIndenter(radius, depth), 0.7
    x = np.arange(-7.0, 7.0001, 0.05)
    solved, contact = solve_drape(ball.obstacle, x, x, decay_mm=decay)
    b = contact_radius(ball.profile, ball.reach_mm, decay)
    r = np.hypot(*np.meshgrid(x, x))
    edge = depth - radius + math.sqrt(radius**2 - b**2)
    outside = edge * k0(np.maximum(r, b) / decay) / k0(b / decay)
    expected = np.where(r <= b, ball.obstacle(r, 0.0 * r), outside)
    # The five-point stencil's error is (pitch / decay)^2 / 12 of the depth: 0.4 um.
    assert np.abs(solved - expected).max() < 5e-4
    assert math.sqrt(contact.sum() * 0.05**2 / math.pi) == pytest.approx(b, abs=0.05)


def test_cylinder_outside_its_contact_follows_k0():
    surface = press_surface(CylinderIndenter(5.0, 1.0, 0.0), x_mm=1.0, y_mm=-0.5, decay_mm=0.7)
    x, y = np.meshgrid(surface.x_mm - 1.0, surface.y_mm + 0.5)
    r = np.hypot(x, y)
    ring = (r > 2.6) & (r < 5.0)
    assert np.allclose(surface.depth_mm[ring], k0(r[ring] / 0.7) / k0(2.5 / 0.7), atol=1e-12)
    assert np.allclose(surface.depth_mm[r < 2.5], 1.0)


@pytest.mark.parametrize(
    "shape",
    [CuboidIndenter(2.0, 0.7), ReliefIndenter(np.array([[0.2, 0.4], [0.1, 0.3]]), 2.0, 0.5)],
)
def test_membrane_lies_on_the_indenter_and_obeys_the_foundation_elsewhere(shape):
    pitch, decay = 0.05, 0.6
    x = pitch * np.arange(-100, 101)
    depth, contact = solve_drape(shape.obstacle, x, x, decay_mm=decay)
    obstacle = shape.obstacle(*np.meshgrid(x, x))
    assert (depth >= obstacle - 1e-12).all()
    around = depth[2:, 1:-1] + depth[:-2, 1:-1] + depth[1:-1, 2:] + depth[1:-1, :-2]
    bend = decay**2 * (around - 4.0 * depth[1:-1, 1:-1]) / pitch**2
    rest = (bend - depth[1:-1, 1:-1])[~contact[1:-1, 1:-1]]
    assert np.abs(rest).max() < 1e-3
    # In contact the indenter can only push, never pull.
    pushed = (bend - depth[1:-1, 1:-1])[contact[1:-1, 1:-1]]
    assert pushed.max() < 1e-3


@pytest.mark.parametrize("relief", [coin(8.0, 0.5), nut(5.5, 0.5)])
def test_reliefs_are_pressed_to_the_depth_asked_for(relief):
    surface = press_surface(relief, yaw_deg=20.0, pitch_mm=0.08)
    assert surface.depth_mm.max() == pytest.approx(0.5, abs=0.005)
    # The contact is larger than the rim and smaller than the whole circle.
    assert 3.0 < surface.contact.sum() * 0.08**2 < math.pi * 4.0**2
    assert surface.depth_mm[surface.contact].std() > 0.01
