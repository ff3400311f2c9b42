"""The ball's geometry against closed forms, and its centre from the shading."""

import numpy as np
import pytest
import scene
from hypothesis import given, settings
from hypothesis import strategies as st

from gelpolight_core.geometry.drape import ball_contact_from_depth, ball_depth_from_contact
from gelpolight_core.light.directions import light_directions
from gelpolight_core.stages.balls.ball_geometry import (
    BallPose,
    ShadedPixels,
    ball_surface,
    refine_centre,
)


def test_depth_and_contact_radius_agree_with_a_rendered_ball():
    """Figures of a ball pressed into an elastic foundation of 0.7 mm decay, solved elsewhere."""
    assert ball_depth_from_contact(1.558946, 3.0) == pytest.approx(0.7898, abs=2e-4)
    assert ball_contact_from_depth(0.7898, 3.0, decay_mm=0.7) == pytest.approx(1.558946, abs=5e-4)


@given(st.floats(0.3, 0.9), st.floats(1.0, 8.0))
def test_contact_and_depth_are_each_others_inverse(share, radius):
    contact = share * radius
    depth = ball_depth_from_contact(contact, radius)
    assert ball_contact_from_depth(depth, radius, decay_mm=0.7) == pytest.approx(contact, rel=1e-6)


@given(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2), st.floats(-0.4, 0.4), st.floats(-0.4, 0.4))
def test_rays_meet_the_ball_on_its_surface_on_the_side_of_the_camera(
    x, y, ray_slope_x, ray_slope_y
):
    pose = BallPose((0.0, 0.0), 3.0, 1.0)
    surface, normal = ball_surface(np.array([[x, y]]), np.array([[ray_slope_x, ray_slope_y]]), pose)
    assert np.linalg.norm(surface[0] - [0.0, 0.0, 2.0]) == pytest.approx(3.0)
    assert normal[0, 2] < 0.0
    depth = -surface[0, 2]
    np.testing.assert_allclose(surface[0, :2], [x + depth * ray_slope_x, y + depth * ray_slope_y])


def shaded(pose: BallPose, glossy: float, exponent: float) -> ShadedPixels:
    """Return a ball's pixels, shaded with a Phong lobe (not the half-vector lobe of the fit)."""
    rng = np.random.default_rng(2)
    angle, radius = rng.uniform(0, 2 * np.pi, 3000), 1.5 * np.sqrt(rng.uniform(0, 1, 3000))
    centre = np.array(pose.centre_mm)
    points = centre + 0.05 + np.stack([radius * np.cos(angle), radius * np.sin(angle)], -1)
    ray_slope = -0.02 * points
    surface, normal = ball_surface(points, ray_slope, pose)

    def shade(at: np.ndarray, n: np.ndarray) -> np.ndarray:
        light, distance = light_directions(scene.LEDS, at)
        cosine = np.einsum("nkc,nc->nk", light, n)
        mirrored = 2 * cosine[..., None] * n[:, None, :] - light
        view = np.concatenate([ray_slope, -np.ones((len(ray_slope), 1))], axis=1)
        view /= np.linalg.norm(view, axis=1, keepdims=True)
        lobe = np.clip(np.einsum("nkc,nc->nk", mirrored, view), 0, 1) ** 4
        lit = (1 - glossy) * np.clip(cosine, 0, 1) ** exponent + glossy * lobe
        return np.asarray(lit * -light[..., 2] / distance**2)

    flat = np.concatenate([points, np.zeros((len(points), 1))], axis=1)
    ratio = shade(surface, normal) / shade(flat, np.tile([0.0, 0.0, -1.0], (len(points), 1)))
    ratio *= 1.0 + 0.01 * rng.normal(size=ratio.shape)
    return ShadedPixels(points, ray_slope, ratio, np.full(ratio.shape, 50.0))


@settings(max_examples=8, deadline=None)
@given(
    st.floats(-6.0, 6.0),
    st.floats(-5.0, 5.0),
    st.floats(-0.32, 0.32),
    st.floats(-0.32, 0.32),
    st.floats(0.8, 1.3),
)
def test_the_shading_pulls_a_wrong_centre_to_the_right_place(x, y, off_x, off_y, exponent):
    pixels = shaded(BallPose((x, y), 3.0, 0.9), 0.0, exponent)
    found, misfit, sd = refine_centre(
        pixels, BallPose((x + off_x, y + off_y), 3.0, 0.9), scene.LEDS
    )
    np.testing.assert_allclose(found.centre_mm, [x, y], atol=0.01)
    assert misfit < 0.05
    assert sd < 0.01


def test_a_glossy_membrane_moves_the_centre_less_than_the_bar():
    pixels = shaded(BallPose((4.0, -3.0), 3.0, 0.9), 0.25, 1.0)
    found, _, _ = refine_centre(pixels, BallPose((4.1, -3.1), 3.0, 0.9), scene.LEDS)
    np.testing.assert_allclose(found.centre_mm, [4.0, -3.0], atol=0.05)
