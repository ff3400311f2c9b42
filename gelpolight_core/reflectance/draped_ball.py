"""A pressed ball with the membrane draped around it, seen along the camera's rays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import k0, k1

from gelpolight_core.reflectance.ball import BallPose, contact_radius_from_depth

Array = NDArray[np.float64]
ROUNDS = 6


def draped_ball(
    points_mm: Array, ray_slope: Array, pose: BallPose, *, decay_mm: float
) -> tuple[Array, Array, NDArray[np.bool_]]:
    """Return the point and normal where each ray meets a pressed ball or its drape.

    Inside the contact the membrane is the ball; outside it decays as on an elastic foundation,
    ``w = w_a K0(r / decay) / K0(a / decay)``, and leaves the ball tangentially.

    Parameters
    ----------
    points_mm, ray_slope : (N, 2)
        Intersections of the rays with the undeformed top surface, and their lateral displacement
        per mm of depth.
    pose : BallPose
        The ball.
    decay_mm : float
        Decay length of the membrane.

    Returns
    -------
    surface_mm : (N, 3)
        Seen points, sensor frame.
    normals : (N, 3)
        Unit normals towards the camera.
    on_ball : (N,)
        Whether the point is in the contact.
    """
    radius = pose.radius_mm
    contact = contact_radius_from_depth(pose.depth_mm, radius, decay_mm=decay_mm)
    ring = pose.depth_mm - radius + np.sqrt(radius**2 - contact**2)
    share = ring / k0(contact / decay_mm)
    x, y = np.ascontiguousarray((points_mm - pose.centre_mm).T)
    slope_x, slope_y = np.ascontiguousarray(ray_slope.T)

    def profile(r: Array) -> Array:
        depth = pose.depth_mm - radius + np.sqrt(radius**2 - np.minimum(r, contact) ** 2)
        free = r >= contact
        depth[free] = share * k0(r[free] / decay_mm)
        return depth

    depth = np.full(len(points_mm), 0.5 * pose.depth_mm)
    for _ in range(ROUNDS):  # each round shrinks the error by slope times ray slope, about a tenth
        depth = profile(np.hypot(x + depth * slope_x, y + depth * slope_y))
    position = points_mm + depth[:, None] * ray_slope
    away = position - pose.centre_mm
    r = np.maximum(np.hypot(away[:, 0], away[:, 1]), 1e-9)
    free, inside = r >= contact, np.minimum(r, contact)
    slope = -inside / np.sqrt(radius**2 - inside**2)
    slope[free] = -share / decay_mm * k1(r[free] / decay_mm)
    normals = np.concatenate([-slope[:, None] * away / r[:, None], -np.ones((len(r), 1))], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return np.concatenate([position, -depth[:, None]], axis=1), normals, ~free
