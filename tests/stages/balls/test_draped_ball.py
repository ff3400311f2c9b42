"""A pressed ball with its drape as the camera sees it, against the simulator and a ray march."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates

from gelpolight_core.geometry.membrane_shape import MembraneShape
from gelpolight_core.simulation.design_parts import MembraneDesign
from gelpolight_core.simulation.drape import contact_radius, free_profile
from gelpolight_core.simulation.indenters import BallIndenter, press_surface
from gelpolight_core.stages.balls.ball_geometry import BallPose
from gelpolight_core.stages.balls.draped_ball import draped_ball

Array = NDArray[np.float64]


def simulated_depth(points_mm: Array, pose: BallPose, decay_mm: float) -> Array:
    """Return the simulator's depth of the membrane at true positions (..., 2)."""
    ball = BallIndenter(pose.radius_mm, pose.depth_mm)
    b = contact_radius(ball.profile, ball.reach_mm, decay_mm)
    r = np.hypot(points_mm[..., 0] - pose.centre_mm[0], points_mm[..., 1] - pose.centre_mm[1])
    edge, _ = ball.profile(b)
    outside = free_profile(np.maximum(r, b), b, edge, decay_mm)
    return np.where(r <= b, ball.obstacle(np.minimum(r, b), 0.0 * r), outside)


def marched_depth(point: Array, ray_slope: Array, pose: BallPose, decay_mm: float) -> float:
    """Return where a ray from the camera first meets the simulator's surface.

    It comes from above the deepest point; between samples of 1/500 of the depth it is halved.
    """

    def above(depth: Array) -> Array:
        return depth - simulated_depth(point + depth[:, None] * ray_slope, pose, decay_mm)

    samples = np.linspace(1.01 * pose.depth_mm, 0.0, 500)
    below = np.flatnonzero(above(samples) <= 0.0)
    low, high = samples[below[0]], samples[below[0] - 1]
    for _ in range(50):
        middle = 0.5 * (low + high)
        if above(np.array([middle]))[0] <= 0.0:
            low = middle
        else:
            high = middle
    return float(low)


def field(pose: BallPose, spread_mm: float, count: int, seed: int) -> Array:
    random = np.random.default_rng(seed)
    return np.asarray(pose.centre_mm) + random.uniform(-spread_mm, spread_mm, (count, 2))


# What is pressed in practice: the ball's slope at the contact's edge stays below about 45 degrees,
# and rays lean at most 20 degrees inside the elastomer.
poses = st.builds(
    lambda x, y, radius, share: BallPose((x, y), radius, share * radius),
    st.floats(-6.0, 6.0),
    st.floats(-6.0, 6.0),
    st.floats(2.0, 5.0),
    st.floats(0.08, 0.35),
)
decays = st.floats(0.4, 1.2)


@settings(max_examples=40, deadline=None)
@given(poses, decays, st.integers(0, 99))
def test_upright_rays_see_the_simulators_drape(pose, decay, seed):
    points = field(pose, 2.5 * decay + pose.radius_mm, 200, seed)
    surface, _, on_ball = draped_ball(points, np.zeros_like(points), pose, decay_mm=decay)
    np.testing.assert_allclose(surface[:, :2], points, atol=1e-12)
    np.testing.assert_allclose(-surface[:, 2], simulated_depth(points, pose, decay), atol=1e-7)
    ball = BallIndenter(pose.radius_mm, pose.depth_mm)
    b = contact_radius(ball.profile, ball.reach_mm, decay)
    r = np.linalg.norm(points - pose.centre_mm, axis=1)
    clear = np.abs(r - b) > 1e-5
    np.testing.assert_array_equal(on_ball[clear], (r < b)[clear])


@settings(max_examples=20, deadline=None)
@given(poses, decays, st.floats(-0.25, 0.25), st.floats(-0.25, 0.25))
def test_leaning_rays_end_where_a_ray_march_ends_with_normals_square_to_the_surface(
    pose, decay, ray_slope_x, ray_slope_y
):
    points = field(pose, 2.0 * decay + pose.radius_mm, 100, 1)
    ray_slope = np.tile([ray_slope_x, ray_slope_y], (len(points), 1))
    surface, normals, _ = draped_ball(points, ray_slope, pose, decay_mm=decay)
    expected = [
        marched_depth(p, w, pose, decay) for p, w in zip(points[:15], ray_slope[:15], strict=True)
    ]
    # Six rounds, each shrinking the error by ray slope times slope (at most 0.35): below 1 um.
    np.testing.assert_allclose(-surface[:15, 2], expected, atol=1e-3)
    np.testing.assert_allclose(
        surface[:, :2], points - surface[:, 2:] * ray_slope, atol=1e-12
    )  # on its own ray
    place, step = surface[:, :2], 1e-4
    ball = BallIndenter(pose.radius_mm, pose.depth_mm)
    b = contact_radius(ball.profile, ball.reach_mm, decay)
    r = np.linalg.norm(place - pose.centre_mm, axis=1)
    clear = (np.abs(r - b) > 3 * step) & (r > 0.05)
    assert clear.sum() > 50
    slope = np.stack(
        [
            simulated_depth(place + move, pose, decay) - simulated_depth(place - move, pose, decay)
            for move in (np.array([step, 0.0]), np.array([0.0, step]))
        ],
        axis=-1,
    ) / (2.0 * step)
    expected = np.concatenate([-slope, -np.ones((len(slope), 1))], axis=1)
    expected /= np.linalg.norm(expected, axis=1, keepdims=True)
    np.testing.assert_allclose(normals[clear], expected[clear], atol=1e-4)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-12)
    assert (normals[:, 2] < 0.0).all()


def test_the_ball_may_be_seen_exactly_at_its_lowest_point():
    surface, normals, on_ball = draped_ball(
        np.zeros((1, 2)), np.zeros((1, 2)), BallPose((0.0, 0.0), 3.0, 1.0), decay_mm=0.7
    )
    assert surface[0].tolist() == pytest.approx([0.0, 0.0, -1.0])
    assert math.isclose(normals[0, 2], -1.0)
    assert on_ball[0]


def test_a_ball_in_a_curved_membrane_drapes_like_the_simulators():
    centre = (3.0, 8.0)
    pose = BallPose(centre, 3.0, 0.9)
    at_rest = MembraneDesign(working_diameter_mm=26.0, apex_height_mm=3.5)
    ball = BallIndenter(pose.radius_mm, pose.depth_mm)
    made = press_surface(
        ball, x_mm=centre[0], y_mm=centre[1], decay_mm=0.7, rest=at_rest, pitch_mm=0.02
    )
    points = field(pose, 2.5, 400, 4)
    cap = MembraneShape("spherical_cap", 3.5, 26.0)
    surface, normals, on_ball = draped_ball(
        points, np.zeros_like(points), pose, decay_mm=0.7, surface=cap
    )
    place = [(points[:, 1] - made.y0_mm) / 0.02, (points[:, 0] - made.x0_mm) / 0.02]
    expected, touched, slope_x, slope_y = (
        map_coordinates(values, place, order=3)
        for values in (made.depth_mm, made.contact.astype(float), made.slope_x, made.slope_y)
    )
    # The simulator's grid is right to 0.1 um, and its slopes to half a cell's bend at the edge.
    assert cap.height(points) - surface[:, 2] == pytest.approx(expected, abs=1e-4)
    slopes = cap.slopes(points) - np.stack([slope_x, slope_y], axis=-1)
    assert normals[:, :2] / -normals[:, 2:] == pytest.approx(slopes, abs=0.01)
    clear = (touched < 1e-3) | (touched > 0.999)
    assert clear.mean() > 0.9
    np.testing.assert_array_equal(on_ball[clear], touched[clear] > 0.5)


def test_far_from_a_ball_a_curved_membrane_is_at_rest():
    cap, points = MembraneShape("spherical_cap", 2.0, 26.0), np.array([[9.0, -6.0], [-8.0, -8.0]])
    pose, rays = BallPose((-2.0, 3.0), 3.0, 1.0), np.array([[-0.2, 0.1], [0.2, 0.2]])
    seen, normals, on_ball = draped_ball(points, rays, pose, decay_mm=0.7, surface=cap)
    np.testing.assert_allclose(seen, cap.points(points), atol=1e-9)
    np.testing.assert_allclose(normals, cap.normals(points), atol=1e-9)
    assert not on_ball.any()
