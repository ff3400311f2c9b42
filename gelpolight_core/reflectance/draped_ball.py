"""A pressed ball with the membrane draped around it, seen along the camera's rays."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import k0e, k1e

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
    scale = k0e(contact / decay_mm)
    centre = np.asarray(pose.centre_mm)

    def profile(r: Array) -> Array:
        outside = np.maximum(r, contact)
        inside = np.minimum(r, contact)
        drape = ring * k0e(outside / decay_mm) / scale * np.exp((contact - outside) / decay_mm)
        ball = pose.depth_mm - radius + np.sqrt(radius**2 - inside**2)
        return np.where(r < contact, ball, drape)

    depth = np.full(len(points_mm), 0.5 * pose.depth_mm)
    for _ in range(ROUNDS):  # each round shrinks the error by slope times ray slope, about a tenth
        away = points_mm + depth[:, None] * ray_slope - centre
        depth = profile(np.hypot(away[:, 0], away[:, 1]))
    position = points_mm + depth[:, None] * ray_slope
    away = position - centre
    r = np.maximum(np.hypot(away[:, 0], away[:, 1]), 1e-9)
    outside, inside = np.maximum(r, contact), np.minimum(r, contact)
    drape = -ring / decay_mm * k1e(outside / decay_mm) / scale
    drape *= np.exp((contact - outside) / decay_mm)
    slope = np.where(r < contact, -inside / np.sqrt(radius**2 - inside**2), drape)
    normals = np.concatenate([-slope[:, None] * away / r[:, None], -np.ones((len(r), 1))], axis=1)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    return np.concatenate([position, -depth[:, None]], axis=1), normals, r < contact
